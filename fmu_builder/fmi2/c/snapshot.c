/* A saved state as bytes: 64-bit words, least significant byte first on every platform.
   word 0 mark, 1 format version, 2 size in bytes, 3..10 GUID (zero padded), the Slave's words, checksum. */

#define SNAPSHOT_MARK 0x4554415453554d46u /* "FMUSTATE" */
enum { SNAPSHOT_VERSION = 2, SNAPSHOT_GUID_BYTES = 64, SNAPSHOT_WORD = 8 };
enum { SNAPSHOT_HEADER = 3 * SNAPSHOT_WORD + SNAPSHOT_GUID_BYTES };
enum { SNAPSHOT_SIZE = SNAPSHOT_HEADER + sizeof(Slave) + SNAPSHOT_WORD };

/* Compile-time checks: words without a rest, and a GUID that fits. */
typedef char slave_is_made_of_words[sizeof(Slave) % SNAPSHOT_WORD == 0 ? 1 : -1];
typedef char guid_fits[sizeof(MODEL_GUID) <= SNAPSHOT_GUID_BYTES ? 1 : -1];

/** bytes[0..8) = word, least significant byte first */
static void write_word(unsigned char *bytes, uint64_t word)
{
    for (unsigned k = 0; k < SNAPSHOT_WORD; ++k) {
        bytes[k] = (unsigned char)(word >> (8u * k) & 0xffu);
    }
}

/** word from bytes[0..8), least significant byte first */
static uint64_t read_word(const unsigned char *bytes)
{
    uint64_t word = 0;
    for (unsigned k = 0; k < SNAPSHOT_WORD; ++k) {
        word |= (uint64_t)bytes[k] << (8u * k);
    }
    return word;
}

/** FNV-1a over bytes[0..size) */
static uint64_t checksum(const unsigned char *bytes, size_t size)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t k = 0; k < size; ++k) {
        hash = (hash ^ bytes[k]) * 0x100000001b3u;
    }
    return hash;
}

/** the header that a state of this model has */
static void write_header(unsigned char *bytes)
{
    static const char guid[SNAPSHOT_GUID_BYTES] = MODEL_GUID;
    write_word(bytes, SNAPSHOT_MARK);
    write_word(bytes + SNAPSHOT_WORD, SNAPSHOT_VERSION);
    write_word(bytes + 2 * SNAPSHOT_WORD, SNAPSHOT_SIZE);
    for (unsigned k = 0; k < SNAPSHOT_GUID_BYTES; ++k) {
        bytes[3 * SNAPSHOT_WORD + k] = (unsigned char)guid[k];
    }
}

/** bytes[0..SNAPSHOT_SIZE) = slave */
static void snapshot_write(const Slave *slave, unsigned char *bytes)
{
    const unsigned char *memory = (const unsigned char *)slave;
    union {
        uint64_t word;
        unsigned char bytes[SNAPSHOT_WORD];
    } native;
    write_header(bytes);
    for (size_t at = 0; at < sizeof(Slave); at += SNAPSHOT_WORD) {
        for (unsigned k = 0; k < SNAPSHOT_WORD; ++k) {
            native.bytes[k] = memory[at + k];
        }
        write_word(bytes + SNAPSHOT_HEADER + at, native.word);
    }
    write_word(bytes + SNAPSHOT_SIZE - SNAPSHOT_WORD, checksum(bytes, SNAPSHOT_SIZE - SNAPSHOT_WORD));
}

/** NULL when bytes[0..size) is a saved state of this model, else what is wrong with it */
static const char *snapshot_check(const unsigned char *bytes, size_t size)
{
    unsigned char header[SNAPSHOT_HEADER];
    if (size < SNAPSHOT_HEADER || read_word(bytes) != SNAPSHOT_MARK) {
        return "these bytes are not a saved state";
    }
    if (read_word(bytes + SNAPSHOT_WORD) != SNAPSHOT_VERSION) {
        return "the saved state has another format version";
    }
    write_header(header);
    for (unsigned k = 3 * SNAPSHOT_WORD; k < SNAPSHOT_HEADER; ++k) {
        if (bytes[k] != header[k]) {
            return "the saved state belongs to another FMU (its GUID differs)";
        }
    }
    if (size != SNAPSHOT_SIZE || read_word(bytes + 2 * SNAPSHOT_WORD) != SNAPSHOT_SIZE) {
        return "the saved state does not have the right length";
    }
    if (read_word(bytes + size - SNAPSHOT_WORD) != checksum(bytes, size - SNAPSHOT_WORD)) {
        return "the saved state is damaged (its checksum differs)";
    }
    return NULL;
}

/** slave = bytes that snapshot_check accepts */
static void snapshot_read(Slave *slave, const unsigned char *bytes)
{
    unsigned char *memory = (unsigned char *)slave;
    union {
        uint64_t word;
        unsigned char bytes[SNAPSHOT_WORD];
    } native;
    for (size_t at = 0; at < sizeof(Slave); at += SNAPSHOT_WORD) {
        native.word = read_word(bytes + SNAPSHOT_HEADER + at);
        for (unsigned k = 0; k < SNAPSHOT_WORD; ++k) {
            memory[at + k] = native.bytes[k];
        }
    }
}
