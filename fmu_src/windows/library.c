/* A library for Windows is built with the C run time of the system, without the libraries of MinGW, which take a minute to
 * compile. Here is what it lacks then: its entry point, the mark that it uses floating-point numbers, and two functions of
 * <stdio.h> that the run time has only under another name. */
#include <stdarg.h>
#include <stdio.h>

enum { AS_IN_C99 = 2 }; /* _CRT_INTERNAL_PRINTF_STANDARD_SNPRINTF_BEHAVIOR: '\0' at the end, and the length of the whole text */

int _fltused;

/* Windows calls this when a process loads the library. Nothing has to be initialized. */
int __stdcall begin_library(void *library, unsigned long reason, void *reserved);
int __stdcall begin_library(void *library, unsigned long reason, void *reserved)
{
    (void)library, (void)reason, (void)reserved;
    return 1;
}

int vsnprintf(char *text, size_t size, const char *format, va_list arguments)
{
    return __stdio_common_vsprintf(AS_IN_C99, text, size, format, NULL, arguments);
}

int snprintf(char *text, size_t size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(text, size, format, arguments);
    va_end(arguments);
    return length;
}
