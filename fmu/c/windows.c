/* What a library for Windows needs beside itself: a few functions that MinGW would add from a C library of its own, which takes
   minutes to build. Here they stand on the Universal C Runtime, a part of Windows 10 and later. Not a part of the FMU's sources. */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>

#define C99 2ULL /* what `__stdio_common_vsprintf` takes for: cut off as C99's vsnprintf, say the whole length */

int __stdio_common_vsprintf(unsigned long long options, char *, size_t, const char *format, void *locale, va_list);

int vsnprintf(char *restrict buffer, size_t n, const char *restrict format, va_list list) {
    return __stdio_common_vsprintf(C99, buffer, n, format, NULL, list);
}

int snprintf(char *restrict buffer, size_t n, const char *restrict format, ...) {
    va_list list;
    int length;
    va_start(list, format);
    length = vsnprintf(buffer, n, format, list);
    va_end(list);
    return length;
}

/* Behind `isfinite` and its like. */
int __fpclassify(double x) {
    union {
        double value;
        unsigned long long bits;
    } number = {x};
    unsigned exponent = (unsigned)(number.bits >> 52) & 0x7ff;
    unsigned long long fraction = number.bits << 12;
    if (exponent == 0x7ff) return fraction ? FP_NAN : FP_INFINITE;
    if (exponent) return FP_NORMAL;
    return fraction ? FP_SUBNORMAL : FP_ZERO;
}

/* Called where a function's variables are larger than a page (4096 bytes), their size in rax: Windows gives a stack page by page,
   so each is touched in turn. All registers stay as they are. */
__asm__(
    ".globl ___chkstk_ms\n"
    "___chkstk_ms:\n"
    "  pushq %rcx\n"
    "  pushq %rax\n"
    "  leaq 24(%rsp), %rcx\n" /* the stack before the call */
    "1:\n"
    "  cmpq $4096, %rax\n"
    "  jbe 2f\n"
    "  subq $4096, %rcx\n"
    "  orq $0, (%rcx)\n"
    "  subq $4096, %rax\n"
    "  jmp 1b\n"
    "2:\n"
    "  subq %rax, %rcx\n"
    "  orq $0, (%rcx)\n"
    "  popq %rax\n"
    "  popq %rcx\n"
    "  ret\n");
