/* The library of the Python flavour on Linux. PythonFMU's own library, which this one is linked to, takes the URI of the resource
 * folder for a path, and decodes only spaces; if it finds no files there, it crashes. This function gives it the path instead.
 * All other functions are PythonFMU's. */
#define _GNU_SOURCE
#include "fmi2Functions.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int digit(char c)
{
    const char *const digits = "0123456789abcdef0123456789ABCDEF", *const found = c == '\0' ? NULL : strchr(digits, c);
    return found == NULL ? -1 : (int)(found - digits) % 16;
}

/* Write the path of a file URI, which is no shorter than the path. */
static void decode(const char *uri, char *path)
{
    if (strncmp(uri, "file:", 5) == 0) {
        uri += 5;
        if (strncmp(uri, "//", 2) == 0) { /* the name of a host follows, or nothing */
            uri += 2 + strcspn(uri + 2, "/");
        }
    }
    for (; *uri != '\0'; uri++) {
        const int high = *uri == '%' ? digit(uri[1]) : -1, low = high < 0 ? -1 : digit(uri[2]);
        *path++ = low < 0 ? *uri : (char)(16 * high + low);
        uri += low < 0 ? 0 : 2;
    }
    *path = '\0';
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    fmi2InstantiateTYPE *const original = (fmi2InstantiateTYPE *)dlsym(RTLD_NEXT, "fmi2Instantiate");
    char *const path = location == NULL ? NULL : (char *)malloc(strlen(location) + 64), file[] = "slavemodule.txt";
    if (original == NULL || path == NULL || functions == NULL) {
        free(path);
        return NULL;
    }
    decode(location, path);
    int folder = open(path, O_PATH | O_DIRECTORY | O_CLOEXEC);
    fmi2Component instance = NULL;
    if (folder < 0 || faccessat(folder, file, R_OK, 0) != 0) {
        functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError",
                          "fmi2Instantiate: the resource folder %s has no file %s.", location, file);
    } else {
        if (strstr(path, "%20") != NULL) { /* PythonFMU would make a space of it; the folder stays open for this path */
            sprintf(path, "/proc/self/fd/%d", folder);
            folder = -1;
        }
        instance = original(name, type, guid, path, functions, visible, logging);
    }
    if (folder >= 0) {
        close(folder);
    }
    free(path);
    return instance;
}
