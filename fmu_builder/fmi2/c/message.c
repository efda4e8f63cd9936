/* Text for the logger without a C library. Too long a text is cut. */

/* What only runs when something is said: kept small and out of the way of what runs in every step. */
#if defined(__clang__)
#define COLD __attribute__((cold, noinline, minsize))
#elif defined(__GNUC__)
#define COLD __attribute__((cold, noinline))
#else
#define COLD
#endif

/* What runs in every call, but need not be there once per call; SMALL, and is mostly refusals. */
#if defined(__clang__)
#define APART __attribute__((noinline))
#define SMALL __attribute__((noinline, minsize))
#elif defined(__GNUC__)
#define APART __attribute__((noinline))
#define SMALL __attribute__((noinline))
#else
#define APART
#define SMALL
#endif

enum { MESSAGE_CAPACITY = 512 };

typedef struct {
    char text[MESSAGE_CAPACITY];
    unsigned length;
} Message;

/** text number k of texts that stand one behind the other */
static COLD const char *text_at(const char *texts, unsigned k)
{
    while (k > 0) {
        k -= *texts++ == '\0'; /* not a loop per text, which compilers make a call of strlen */
    }
    return texts;
}

/** empty message */
static void message_clear(Message *message)
{
    message->length = 0;
    message->text[0] = '\0';
}

/** message + text; % and # become ' because loggers give them a meaning */
static COLD void message_append(Message *message, const char *text)
{
    while (*text != '\0' && message->length + 1 < MESSAGE_CAPACITY) {
        const char letter = *text++;
        message->text[message->length++] = letter;
        if (letter == '%' || letter == '#') {
            message->text[message->length - 1] = '\'';
        }
    }
    message->text[message->length] = '\0';
}

/** message + value as a decimal integer; without division, which 32-bit processors leave to a library for 64 bits */
static COLD void message_append_integer(Message *message, long long value)
{
    char digits[24];
    unsigned length = 0;
    unsigned long long rest = value < 0 ? 0ull - (unsigned long long)value : (unsigned long long)value;
    if (value < 0) {
        digits[length++] = '-';
    }
    for (int place = 18; place >= 0; --place) { /* 10^18 is the largest power below 2^63 */
        unsigned digit = 0;
        unsigned long long unit = 1;
        for (int k = 0; k < place; ++k) {
            unit *= 10u;
        }
        while (rest >= unit) {
            rest -= unit;
            ++digit;
        }
        if (digit != 0 || place == 0 || (length > 0 && digits[length - 1] != '-')) {
            digits[length++] = (char)('0' + (int)digit);
        }
    }
    digits[length] = '\0';
    message_append(message, digits);
}

/** message + 0.d1..d6 10^(exponent + 1) without trailing zeros: plain where short, else with an exponent */
static COLD void message_append_digits(Message *message, long digits, int exponent)
{
    const int plain = exponent >= -5 && exponent < 6;
    char text[32];
    unsigned length = 0;
    int count = 6;
    while (count > 1 && digits % 10 == 0) {
        digits /= 10;
        --count;
    }
    int point = plain ? exponent : 0; /* decimal place of the first digit */
    if (point < 0) {
        text[length++] = '0';
        text[length++] = '.';
        for (int zero = -1; zero > point; --zero) {
            text[length++] = '0';
        }
    }
    long unit = 1;
    for (int k = 1; k < count; ++k) {
        unit *= 10;
    }
    for (int place = point; unit > 0 || place >= 0; --place) {
        if (place == -1 && point >= 0) {
            text[length++] = '.';
        }
        text[length++] = (char)('0' + (unit > 0 ? (int)(digits / unit % 10) : 0));
        unit /= 10;
    }
    text[length] = '\0';
    message_append(message, text);
    if (!plain) {
        message_append(message, "e");
        message_append_integer(message, exponent);
    }
}

/** message + value with six significant digits */
static COLD void message_append_number(Message *message, double value)
{
    double size = value < 0.0 ? -value : value;
    int exponent = 0;
    if (!(value - value == 0.0)) {
        message_append(message, value != value ? "not-a-number" : value < 0.0 ? "-infinity" : "infinity");
        return;
    }
    if (value < 0.0) {
        message_append(message, "-");
    }
    if (size == 0.0) {
        message_append(message, "0");
        return;
    }
    for (; size >= 10.0; ++exponent) {
        size /= 10.0;
    }
    for (; size < 1.0; --exponent) {
        size *= 10.0;
    }
    long digits = (long)(size * 100000.0 + 0.5);
    if (digits >= 1000000) {
        digits /= 10;
        ++exponent;
    }
    message_append_digits(message, digits, exponent);
}

/** message + "NAME = value is outside [minimum, maximum]" */
static COLD void message_append_outside(Message *message, const char *name, double value, double minimum, double maximum)
{
    message_append(message, name);
    message_append(message, " = ");
    message_append_number(message, value);
    message_append(message, " is outside [");
    message_append_number(message, minimum);
    message_append(message, ", ");
    message_append_number(message, maximum);
    message_append(message, "]");
}
