/* The clock, shared libraries, and an end with a message. */
#ifndef COMMON_H
#define COMMON_H

#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static void check(bool condition, const char *message)
{
    if (!condition) {
        fprintf(stderr, "%s\n", message);
        exit(1);
    }
}

/* Processor time of this thread: what else runs on the machine does not count. */
static double nanoseconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void *load(const char *path)
{
    void *const library = dlopen(path, RTLD_NOW | RTLD_GLOBAL);
    check(library != NULL, library == NULL ? dlerror() : "");
    return library;
}

/* *function is a pointer to a function of the library. */
static void find(void *library, const char *name, void *function)
{
    void *const found = dlsym(library, name);
    check(found != NULL, name);
    memcpy(function, &found, sizeof found);
}

#endif
