/* Drives FMUs on a platform that a test machine can run: commands from standard input, results to standard output.
   Numbers travel as the 16 hexadecimal digits of their bits, so nothing is rounded on the way. Words are separated by
   white space. On Windows it needs KERNEL32 only, as the FMUs do: a C library there takes the compiler a minute.

   note WORD                 prints it
   load PATH                 a library, in the place of the one before
   new KIND GUID             an instance without callbacks, 0 = model exchange, 1 = co-simulation
   free
   setup                     fmi2SetupExperiment, start time 0
   enter, exit, events, continuous, event
                             initialisation mode, fmi2NewDiscreteStates until nothing changes, the modes of model exchange
   real VR X, integer VR N   set one
   rate VR X                 fmi2SetRealInputDerivatives of order 1
   get VR COUNT              prints COUNT Reals from VR on
   step T H                  fmi2DoStep
   time T                    fmi2SetTime
   euler COUNT T H           fmi2SetContinuousStates of x + H x', then fmi2SetTime of T
   slope UNKNOWN KNOWN       prints a directional derivative
   save                      prints fmi2SerializeFMUstate
   restore BYTES             fmi2DeSerializeFMUstate and fmi2SetFMUstate
   A call that does not return fmi2OK prints "status N". */
#include <stdint.h>

#include "fmi2FunctionTypes.h"

#if defined(_WIN32)
#define IMPORTED __declspec(dllimport)
IMPORTED void *__stdcall LoadLibraryA(const char *name);
IMPORTED void *__stdcall GetProcAddress(void *library, const char *name);
IMPORTED void *__stdcall GetStdHandle(unsigned long which);
IMPORTED int __stdcall ReadFile(void *file, void *bytes, unsigned long size, unsigned long *done, void *overlapped);
IMPORTED int __stdcall WriteFile(void *file, const void *bytes, unsigned long size, unsigned long *done, void *overlapped);
IMPORTED void __stdcall ExitProcess(unsigned code);

static long read_some(char *bytes, unsigned long size)
{
    unsigned long done = 0;
    return ReadFile(GetStdHandle((unsigned long)-10), bytes, size, &done, 0) ? (long)done : 0;
}

static void write_all(const char *bytes, unsigned long size)
{
    unsigned long done = 0;
    (void)WriteFile(GetStdHandle((unsigned long)-11), bytes, size, &done, 0);
}

static void quit(int code) { ExitProcess((unsigned)code); }
static void *open_library(const char *path) { return LoadLibraryA(path); }
static void *find(void *library, const char *name) { return GetProcAddress(library, name); }
#else
#include <dlfcn.h>
#include <stdlib.h>
#include <unistd.h>

static long read_some(char *bytes, unsigned long size) { return (long)read(0, bytes, size); }

static void write_all(const char *bytes, unsigned long size)
{
    while (size > 0) {
        const long done = (long)write(1, bytes, size);
        if (done <= 0) {
            exit(3);
        }
        bytes += done;
        size -= (unsigned long)done;
    }
}

static void quit(int code) { exit(code); }
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

enum { LONGEST_WORD = 1 << 20, MOST_NUMBERS = 64, LARGEST_STATE = 1 << 19 };
static char word[LONGEST_WORD];
static char out[4096];
static unsigned long out_size = 0;

static void flush_out(void)
{
    write_all(out, out_size);
    out_size = 0;
}

static void put(char c)
{
    out[out_size++] = c;
    if (out_size == sizeof out) {
        flush_out();
    }
}

static void put_text(const char *text)
{
    for (; *text != '\0'; ++text) {
        put(*text);
    }
}

static void put_hex(uint64_t bits, int digits)
{
    for (int k = digits - 1; k >= 0; --k) {
        put("0123456789abcdef"[bits >> (4 * k) & 15u]);
    }
}

static void put_double(double value)
{
    union {
        double value;
        uint64_t bits;
    } both;
    both.value = value;
    put_hex(both.bits, 16);
    put(' ');
}

static void fail(const char *why)
{
    put_text("failed: ");
    put_text(why);
    put_text(word);
    put('\n');
    flush_out();
    quit(2);
}

static int next_char(void)
{
    static char buffer[4096];
    static long at = 0, size = 0;
    if (at == size) {
        size = read_some(buffer, sizeof buffer);
        at = 0;
        if (size <= 0) {
            size = 0;
            return -1;
        }
    }
    return (unsigned char)buffer[at++];
}

/** the next word into word[]; its length, 0 at the end */
static unsigned long next_word(void)
{
    unsigned long length = 0;
    int c = next_char();
    while (c == ' ' || c == '\n' || c == '\r') {
        c = next_char();
    }
    while (c > ' ' && length + 1 < LONGEST_WORD) {
        word[length++] = (char)c;
        c = next_char();
    }
    word[length] = '\0';
    return length;
}

static int is(const char *name)
{
    unsigned long k = 0;
    while (word[k] != '\0' && word[k] == name[k]) {
        ++k;
    }
    return word[k] == name[k];
}

static unsigned digit(char c)
{
    return (unsigned)(c <= '9' ? c - '0' : c - 'a' + 10);
}

static double next_double(void)
{
    union {
        double value;
        uint64_t bits;
    } both;
    both.bits = 0;
    (void)next_word();
    for (unsigned long k = 0; word[k] != '\0'; ++k) {
        both.bits = both.bits << 4 | digit(word[k]);
    }
    return both.value;
}

static unsigned next_integer(void)
{
    unsigned value = 0;
    (void)next_word();
    for (unsigned long k = 0; word[k] != '\0'; ++k) {
        value = value * 10u + digit(word[k]);
    }
    return value;
}

static void *library = 0;
static fmi2Component component = 0;

static void *function(const char *name)
{
    void *found = library == 0 ? 0 : find(library, name);
    if (found == 0) {
        fail("no function ");
    }
    return found;
}

/** the function of the library by its type, fmi2NAMETYPE */
#define CALL(name) ((fmi2##name##TYPE *)function("fmi2" #name))

static void check(fmi2Status status)
{
    if (status != fmi2OK) {
        put_text("status ");
        put_hex((uint64_t)status, 1);
        put('\n');
    }
}

static void print_reals(unsigned first, unsigned count)
{
    fmi2ValueReference vr[MOST_NUMBERS];
    double values[MOST_NUMBERS];
    for (unsigned k = 0; k < count && k < MOST_NUMBERS; ++k) {
        vr[k] = first + k;
        values[k] = 0.0;
    }
    check(CALL(GetReal)(component, vr, count, values));
    for (unsigned k = 0; k < count; ++k) {
        put_double(values[k]);
    }
    put('\n');
}

static void euler(unsigned count, double time, double step)
{
    double x[MOST_NUMBERS], rate[MOST_NUMBERS];
    fmi2Boolean enter = fmi2False, terminate = fmi2False;
    check(CALL(GetContinuousStates)(component, x, count));
    check(CALL(GetDerivatives)(component, rate, count));
    for (unsigned k = 0; k < count; ++k) {
        x[k] += step * rate[k];
    }
    check(CALL(SetTime)(component, time));
    check(CALL(SetContinuousStates)(component, x, count));
    check(CALL(CompletedIntegratorStep)(component, fmi2True, &enter, &terminate));
    if (enter || terminate) {
        put_text("event\n");
    }
}

static void events(void)
{
    fmi2EventInfo info;
    do {
        check(CALL(NewDiscreteStates)(component, &info));
    } while (info.newDiscreteStatesNeeded);
    if (info.nextEventTimeDefined) {
        put_double(info.nextEventTime);
        put('\n');
    }
}

static char bytes[LARGEST_STATE];

static void save(void)
{
    fmi2FMUstate state = 0;
    size_t size = 0;
    check(CALL(GetFMUstate)(component, &state));
    check(CALL(SerializedFMUstateSize)(component, state, &size));
    if (size > sizeof bytes) {
        fail("too large a state ");
    }
    check(CALL(SerializeFMUstate)(component, state, bytes, size));
    check(CALL(FreeFMUstate)(component, &state));
    for (size_t k = 0; k < size; ++k) {
        put_hex((unsigned char)bytes[k], 2);
    }
    put('\n');
}

static void restore(void)
{
    fmi2FMUstate state = 0;
    const unsigned long size = next_word() / 2;
    for (unsigned long k = 0; k < size; ++k) {
        bytes[k] = (char)(digit(word[2 * k]) << 4 | digit(word[2 * k + 1]));
    }
    check(CALL(DeSerializeFMUstate)(component, bytes, size, &state));
    check(CALL(SetFMUstate)(component, state));
    check(CALL(FreeFMUstate)(component, &state));
}

static void set_one(int kind)
{
    const fmi2ValueReference vr = next_integer();
    const fmi2Integer one = 1;
    if (kind == 'i') {
        const fmi2Integer number = (fmi2Integer)next_integer();
        check(CALL(SetInteger)(component, &vr, 1, &number));
    } else {
        const double value = next_double();
        check(kind == 'r' ? CALL(SetReal)(component, &vr, 1, &value)
                          : CALL(SetRealInputDerivatives)(component, &vr, 1, &one, &value));
    }
}

static void make(void)
{
    const fmi2Type kind = next_integer() == 0 ? fmi2ModelExchange : fmi2CoSimulation;
    static fmi2CallbackFunctions callbacks;
    (void)next_word();
    component = CALL(Instantiate)("driver", kind, word, "", &callbacks, fmi2False, fmi2False);
    if (component == 0) {
        fail("no instance for ");
    }
}

static void slope(void)
{
    const fmi2ValueReference unknown = next_integer(), known = next_integer();
    const double one = 1.0;
    double change = 0.0;
    check(CALL(GetDirectionalDerivative)(component, &unknown, 1, &known, 1, &one, &change));
    put_double(change);
    put('\n');
}

static int run(void)
{
    while (next_word() > 0) {
        if (is("load")) {
            (void)next_word();
            library = open_library(word);
            if (library == 0) {
                fail("does not load: ");
            }
        } else if (is("note")) {
            (void)next_word();
            put_text(word);
            put('\n');
        } else if (is("new")) {
            make();
        } else if (is("free")) {
            CALL(FreeInstance)(component);
        } else if (is("setup")) {
            check(CALL(SetupExperiment)(component, fmi2False, 0.0, 0.0, fmi2False, 0.0));
        } else if (is("enter")) {
            check(CALL(EnterInitializationMode)(component));
        } else if (is("exit")) {
            check(CALL(ExitInitializationMode)(component));
        } else if (is("event")) {
            check(CALL(EnterEventMode)(component));
        } else if (is("events")) {
            events();
        } else if (is("continuous")) {
            check(CALL(EnterContinuousTimeMode)(component));
        } else if (is("real") || is("integer") || is("rate")) {
            set_one(word[0] == 'i' ? 'i' : word[1] == 'e' ? 'r' : 'd');
        } else if (is("get")) {
            const unsigned first = next_integer();
            print_reals(first, next_integer());
        } else if (is("step")) {
            const double time = next_double();
            check(CALL(DoStep)(component, time, next_double(), fmi2True));
        } else if (is("time")) {
            check(CALL(SetTime)(component, next_double()));
        } else if (is("euler")) {
            const unsigned count = next_integer();
            const double time = next_double();
            euler(count, time, next_double());
        } else if (is("slope")) {
            slope();
        } else if (is("save")) {
            save();
        } else if (is("restore")) {
            restore();
        } else {
            fail("unknown command ");
        }
    }
    put_text("done\n");
    flush_out();
    return 0;
}

#if defined(_WIN32)
void mainCRTStartup(void);
void mainCRTStartup(void) { quit(run()); }
#else
int main(void) { return run(); }
#endif
