/* A vehicle whose commands are sines: set in intermediate update of steps of 0.1 s, before each step of 0.1 ms, and before
 * each step of 0.1 s. Prints by how much the outputs of the second and of the third differ from those of the first, and how
 * often the callback was called. */
#include "fmu.c"

#include "check.h"

static const double LONG = 0.1, SHORT = 1e-4;
enum { N_LONG = 100, N_SHORT_OF_LONG = 1000, N_PLACES = FIRST_CALCULATED - FIRST_STATE };

static size_t updates;

static void command(fmi3Instance instance, double t)
{
    fmi3ValueReference vr[N_VARIABLES];
    double values[N_VARIABLES];
    size_t n = 0;
    for (unsigned i = 0; i < N_VARIABLES; i++) {
        if (VARIABLES[i].kind == INPUT && isfinite(VARIABLES[i].minimum)) {
            values[n] = sin((1.0 + 0.3 * (double)n) * t + (double)n);
            vr[n++] = i + FIRST_REFERENCE;
        }
    }
    CHECK(n > 0 && fmi3SetFloat64(instance, vr, n, values, n) == fmi3OK);
}

/* The environment is where the instance stands. */
static void on_update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested,
                   fmi3Boolean get_allowed, fmi3Boolean step_finished, fmi3Boolean can_return_early,
                   fmi3Boolean *early_return_requested, fmi3Float64 *early_return_time)
{
    CHECK(set_requested && get_allowed && step_finished && !can_return_early);
    (void)early_return_requested;
    (void)early_return_time;
    command(*(fmi3Instance *)environment, time);
    updates++;
}

static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment;
    fprintf(stderr, "%d %s: %s\n", (int)status, category, message);
}

static fmi3Instance new_instance(fmi3InstanceEnvironment environment, fmi3IntermediateUpdateCallback callback)
{
    static const fmi3ValueReference commanded[] = {FIRST_REFERENCE};
    const fmi3Instance instance =
        fmi3InstantiateCoSimulation("rov", MODEL_TOKEN, NULL, fmi3False, fmi3False, fmi3False, fmi3False, commanded,
                                    callback == NULL ? 0 : 1, environment, log_message, callback);
    CHECK(instance != NULL);
    CHECK(fmi3EnterInitializationMode(instance, fmi3False, 0.0, 0.0, fmi3False, 0.0) == fmi3OK);
    CHECK(fmi3ExitInitializationMode(instance) == fmi3OK);
    return instance;
}

static void do_step(fmi3Instance instance, double t, double h)
{
    fmi3Boolean event, terminate, early;
    double last;
    CHECK(fmi3DoStep(instance, t, h, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
    CHECK(!event && !terminate && !early && last == t + h);
}

/* The largest difference between the states of two instances. */
static double difference(fmi3Instance a, fmi3Instance b)
{
    fmi3ValueReference vr[N_PLACES];
    double x[N_PLACES], y[N_PLACES], largest = 0.0;
    for (unsigned i = 0; i < N_PLACES; i++) {
        vr[i] = FIRST_REFERENCE + FIRST_STATE + i;
    }
    CHECK(fmi3GetFloat64(a, vr, N_PLACES, x, N_PLACES) == fmi3OK);
    CHECK(fmi3GetFloat64(b, vr, N_PLACES, y, N_PLACES) == fmi3OK);
    for (int i = 0; i < N_PLACES; i++) {
        largest = fmax(largest, fabs(x[i] - y[i]));
    }
    return largest;
}

int main(void)
{
    fmi3Instance followed;
    followed = new_instance(&followed, on_update);
    const fmi3Instance fine = new_instance(NULL, NULL), held = new_instance(NULL, NULL);
    double by_fine = 0.0, by_held = 0.0;
    for (int i = 0; i < N_LONG; i++) {
        const double t = LONG * i;
        do_step(followed, t, LONG);
        command(held, t);
        do_step(held, t, LONG);
        for (int j = 0; j < N_SHORT_OF_LONG; j++) {
            const double at = SHORT * (N_SHORT_OF_LONG * i + j);
            command(fine, at);
            do_step(fine, at, SHORT);
        }
        by_fine = fmax(by_fine, difference(followed, fine));
        by_held = fmax(by_held, difference(followed, held));
    }
    fmi3FreeInstance(followed);
    fmi3FreeInstance(fine);
    fmi3FreeInstance(held);
    printf("difference %.3e\nheld %.3e\nupdates %zu\n", by_fine, by_held, updates);
    return 0;
}
