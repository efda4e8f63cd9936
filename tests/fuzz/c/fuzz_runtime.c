/* Bytes become calls of an FMU's functions, right and wrong ones, of several instances at a time. Three kinds of oracles:
   sanitizers or valgrind; what the standard says of every call (life.h); and a second instance of each that is told only
   what the first has accepted, and has to come to the same bits.

   Compiled with the FMU's sources and libFuzzer, or with a main of its own (FUZZ_MAIN):
     fuzz_runtime FILE...                    what the bytes of these files say
     fuzz_runtime --seeds FIRST COUNT SIZE   bytes drawn from these seeds */
#include "importer.h"
#include "life.h"
#include "values.h"
#include "calls_values.h"
#include "calls_life.h"
#include "calls_exchange.h"
#include "calls_states.h"
#include "oracles.h"

enum { MOST_CALLS = 400 };

static void (*const calls[])(Pair *) = {
    call_start, call_step, call_step, call_step, call_event, call_event, call_set_real, call_set_real, call_get_real,
    call_directional_derivative, call_set_whole, call_get_whole, call_set_string, call_get_string, call_slopes,
    call_debug_logging, call_setup, call_enter_initialization, call_exit_initialization, call_terminate, call_reset,
    call_status, call_set_time, call_enter_events, call_discrete_states, call_continue, call_completed_step,
    call_set_states, call_set_states, call_get_states, call_save, call_restore, call_free_state, call_serialize,
    call_deserialize, call_free, call_migrate, compare_pair, compare_pair, call_step, call_event
};
enum { CALLS = sizeof calls / sizeof calls[0] };

static void run_calls(void)
{
    for (unsigned count = 0; input_at < input_size && count < MOST_CALLS; ++count) {
        const unsigned first = take();
        Pair *pair = &pairs[take_below(8) % PAIRS];
        if (pair->main == NULL) {
            call_instantiate(pair);
        } else {
            calls[first % CALLS](pair);
        }
        if (first == 255) {
            call_with_nothing();
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    if (fmu.Reset == NULL) {
        fmu_load();
        learn_trace();
    }
    input_bytes = bytes;
    input_size = size;
    input_at = 0;
    run_calls();
    finish();
    return 0;
}

#ifdef FUZZ_MAIN
static uint64_t drawn;

/** splitmix64, one byte of it */
static uint8_t draw(void)
{
    uint64_t mixed = (drawn += 0x9e3779b97f4a7c15U);
    mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9U;
    mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebU;
    return (uint8_t)((mixed ^ (mixed >> 31)) >> 16);
}

static void run_seeds(unsigned long long first, unsigned long long count, size_t size)
{
    uint8_t *bytes = block(size, 1);
    for (unsigned long long seed = first; seed < first + count; ++seed) {
        drawn = seed * 0x2545f4914f6cdd1dU;
        for (size_t k = 0; k < size; ++k) {
            bytes[k] = draw();
        }
        fprintf(stderr, "seed %llu\n", seed);
        (void)LLVMFuzzerTestOneInput(bytes, size);
    }
    free(bytes);
}

static void run_file(const char *path)
{
    static uint8_t bytes[1 << 16];
    FILE *file = fopen(path, "rb");
    REQUIRE(file != NULL, "%s cannot be read", path);
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    (void)LLVMFuzzerTestOneInput(bytes, size);
}

int main(int count, char **words)
{
    if (count == 5 && strcmp(words[1], "--seeds") == 0) {
        run_seeds(strtoull(words[2], NULL, 10), strtoull(words[3], NULL, 10), strtoul(words[4], NULL, 10));
        return 0;
    }
    for (int k = 1; k < count; ++k) {
        run_file(words[k]);
    }
    return 0;
}
#endif
