/* An FMU of FMI 2.0 that this project did not generate. Studies must cope with its faults.

   y' = (a + 2 b + 3 c + gain u - y)/0.5; if fast is true, y is at once what it would become. mode: 1 fails at 1 s, 2 ends
   the process, 3 reads a null pointer, 4 does not return, 5 waits for a millisecond in each step, 6 refuses inputs and
   7 tells nothing once y is positive, 8 cannot be initialized, 9 warns and goes on, 10 refuses a step that ends after
   stopTime, as FMUs of 20-sim do, and one of another length that ends before, 11 does not return from fmi2Terminate,
   12 closes the files of its process, 13 tells an infinite y. The digit in the GUID selects what fmi2Reset does: 0
   resets, 1 does nothing and returns OK, 2 returns an error; with 3 there is no instance. */
#ifdef _WIN32
#include <io.h>
#include <windows.h>
#define CLOSE(file) _close(file)
#define WAIT() Sleep(1)
#else
#define _POSIX_C_SOURCE 199309L
#include <time.h>
#include <unistd.h>
#define CLOSE(file) close(file)
#define WAIT() nanosleep(&(struct timespec){0, 1000000}, NULL)
#endif

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

typedef struct {
    double a, b, c, u, y, stop, length;
    int gain, mode, fast, reset;
    const fmi2CallbackFunctions *host;
} Instance;

static void begin(Instance *i) {
    i->a = i->b = i->c = i->u = i->y = 0.0;
    i->gain = 1;
    i->mode = i->fast = 0;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    if (guid[1] == '3') {
        host->logger(NULL, name, fmi2Error, "error", "no licence");
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    begin(i);
    i->host = host;
    i->reset = guid[1] - '0';
    return i;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real s, fmi2Boolean e, fmi2Real f) {
    ((Instance *)c)->stop = f;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return ((Instance *)c)->mode == 8 ? fmi2Error : fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) {
    while (((Instance *)c)->mode == 11) WAIT();
    return fmi2OK;
}
fmi2Status fmi2Reset(fmi2Component c) {
    const int reset = ((const Instance *)c)->reset;
    if (reset == 0) begin(c);
    return reset == 2 ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    const Instance *i = c;
    const double all[] = {i->a, i->b, i->c, i->u, i->y};
    for (size_t k = 0; k < n; k++) value[k] = all[vr[k]];
    return i->mode == 7 && i->y > 0.0 ? fmi2Discard : i->mode == 9 ? fmi2Warning : fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Instance *i = c;
    double *all[] = {&i->a, &i->b, &i->c, &i->u, &i->y};
    for (size_t k = 0; k < n; k++) *all[vr[k]] = value[k];
    return i->mode == 6 && i->y > 0.0 ? fmi2Discard : i->mode == 9 ? fmi2Warning : fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    const Instance *i = c;
    for (size_t k = 0; k < n; k++) value[k] = vr[k] ? i->mode : i->gain;
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) *(vr[k] ? &i->mode : &i->gain) = value[k];
    return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    for (size_t k = 0; k < n; k++) value[k] = ((const Instance *)c)->fast;
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    for (size_t k = 0; k < n; k++) ((Instance *)c)->fast = value[k];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) {
    Instance *i = c;
    if (i->mode == 2) abort();
    if (i->mode == 3) return *(volatile fmi2Status *)0;
    if (i->mode == 5) WAIT();
    while (i->mode == 4) WAIT();
    if (t == 0.0) i->length = h;
    if (i->mode == 10 && (t + h > i->stop || (t + h < i->stop && h != i->length))) return fmi2Error;
    for (int file = 3; i->mode == 12 && file < 64; file++) CLOSE(file);
    if (i->mode == 1 && t >= 1.0 - 1e-9) {
        i->host->logger(NULL, "foreign", fmi2Warning, "warning", "the pump is blocked");
        i->host->logger(NULL, "foreign", fmi2OK, "info", "goodbye");
        return fmi2Error;
    }
    const double to = i->a + 2.0 * i->b + 3.0 * i->c + i->gain * i->u;
    i->y = i->mode == 13 ? INFINITY : i->fast ? to : to + (i->y - to) * exp(-h / 0.5);
    return i->mode == 9 ? fmi2Warning : fmi2OK;
}

/* Functions that an importer looks up and a study does not call. */
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
#define NOT_THERE(name, ...) \
    fmi2Status name(__VA_ARGS__) { return fmi2Error; }
typedef fmi2Component C;
typedef const fmi2ValueReference *V;
NOT_THERE(fmi2SetDebugLogging, C c, fmi2Boolean on, size_t n, const fmi2String k[])
NOT_THERE(fmi2GetString, C c, V vr, size_t n, fmi2String value[])
NOT_THERE(fmi2SetString, C c, V vr, size_t n, const fmi2String value[])
NOT_THERE(fmi2GetFMUstate, C c, fmi2FMUstate *state)
NOT_THERE(fmi2SetFMUstate, C c, fmi2FMUstate state)
NOT_THERE(fmi2FreeFMUstate, C c, fmi2FMUstate *state)
NOT_THERE(fmi2SerializedFMUstateSize, C c, fmi2FMUstate state, size_t *size)
NOT_THERE(fmi2SerializeFMUstate, C c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NOT_THERE(fmi2DeSerializeFMUstate, C c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
NOT_THERE(fmi2GetDirectionalDerivative, C c, V z, size_t nz, V v, size_t nv, const fmi2Real dv[], fmi2Real dz[])
NOT_THERE(fmi2SetRealInputDerivatives, C c, V vr, size_t n, const fmi2Integer order[], const fmi2Real value[])
NOT_THERE(fmi2GetRealOutputDerivatives, C c, V vr, size_t n, const fmi2Integer order[], fmi2Real value[])
NOT_THERE(fmi2CancelStep, C c)
NOT_THERE(fmi2GetStatus, C c, const fmi2StatusKind kind, fmi2Status *value)
NOT_THERE(fmi2GetRealStatus, C c, const fmi2StatusKind kind, fmi2Real *value)
NOT_THERE(fmi2GetIntegerStatus, C c, const fmi2StatusKind kind, fmi2Integer *value)
NOT_THERE(fmi2GetBooleanStatus, C c, const fmi2StatusKind kind, fmi2Boolean *value)
NOT_THERE(fmi2GetStringStatus, C c, const fmi2StatusKind kind, fmi2String *value)
