/* What a binary without a C library still needs: the memory functions a compiler calls by itself, and on Windows
   the entry point, the floating-point marker and the heap. Not part of an FMU's sources: whoever compiles those
   has a C library. */
#include <stdlib.h>

#if defined(_WIN32)
#define HIDDEN
#else
#define HIDDEN __attribute__((visibility("hidden")))
#endif

HIDDEN void *memcpy(void *restrict target, const void *restrict source, size_t size);
HIDDEN void *memmove(void *target, const void *source, size_t size);
HIDDEN void *memset(void *target, int value, size_t size);

/** target[0..size) = source[0..size), not overlapping */
void *memcpy(void *restrict target, const void *restrict source, size_t size)
{
    unsigned char *to = target;
    const unsigned char *from = source;
    for (size_t k = 0; k < size; ++k) {
        to[k] = from[k];
    }
    return target;
}

/** target[0..size) = source[0..size), overlapping allowed; seldom called */
__attribute__((minsize)) void *memmove(void *target, const void *source, size_t size)
{
    unsigned char *to = target;
    const unsigned char *from = source;
    if ((size_t)to - (size_t)from >= size) {
        for (size_t k = 0; k < size; ++k) {
            to[k] = from[k];
        }
    } else {
        for (size_t k = size; k > 0; --k) {
            to[k - 1] = from[k - 1];
        }
    }
    return target;
}

/** target[0..size) = value */
void *memset(void *target, int value, size_t size)
{
    unsigned char *to = target;
    for (size_t k = 0; k < size; ++k) {
        to[k] = (unsigned char)value;
    }
    return target;
}

#if defined(_WIN32)

#define HEAP_ZERO_MEMORY 0x00000008u

__declspec(dllimport) void *__stdcall GetProcessHeap(void);
__declspec(dllimport) void *__stdcall HeapAlloc(void *heap, unsigned long flags, size_t size);
__declspec(dllimport) int __stdcall HeapFree(void *heap, unsigned long flags, void *memory);
int __stdcall DllMainCRTStartup(void *module, unsigned long reason, void *reserved);

int _fltused = 1; /* the linker asks for it wherever floating point is used */

/** the loader's entry point: nothing to prepare */
int __stdcall DllMainCRTStartup(void *module, unsigned long reason, void *reserved)
{
    (void)module;
    (void)reason;
    (void)reserved;
    return 1;
}

void *calloc(size_t count, size_t size)
{
    if (size != 0 && count > (size_t)-1 / size) {
        return NULL;
    }
    return HeapAlloc(GetProcessHeap(), HEAP_ZERO_MEMORY, count * size);
}

void free(void *memory)
{
    if (memory != NULL) {
        (void)HeapFree(GetProcessHeap(), 0, memory);
    }
}

#endif
