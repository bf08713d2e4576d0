/* Drives the FMU from standard input; the same program on every platform.
 *
 * Usage: host LIBRARY. Each line of input is a step: its length, then the values of the inputs by value reference.
 * Each line of output holds states and thrust after it. Numbers are the bits of a double in hexadecimal: exact
 * everywhere. */
#include "fmu.h"

enum { N_OUTPUTS = N_STATES + N_THRUST };

static int read_double(double *value)
{
    unsigned long long bits;
    const int read = scanf("%llx", &bits);
    memcpy(value, &bits, sizeof *value);
    return read == 1;
}

static void write_double(double value, char end)
{
    unsigned long long bits;
    memcpy(&bits, &value, sizeof bits);
    printf("%016llx%c", bits, end);
}

int main(int argc, char *argv[])
{
    static const fmi2CallbackFunctions callbacks;
    CHECK(argc == 2);
    load_fmu(argv[1]);
    fmi2Component c = new_instance("rov", &callbacks);
    fmi2ValueReference inputs[N_INPUTS], outputs[N_OUTPUTS];
    for (unsigned i = 0; i < N_INPUTS; i++) {
        inputs[i] = i;
    }
    for (unsigned i = 0; i < N_OUTPUTS; i++) {
        outputs[i] = i < N_STATES ? FIRST_STATE + i : FIRST_THRUST + i - N_STATES;
    }
    double t = 0.0, h, values[N_INPUTS > N_OUTPUTS ? N_INPUTS : N_OUTPUTS];
    while (read_double(&h)) {
        for (int i = 0; i < N_INPUTS; i++) {
            CHECK(read_double(&values[i]));
        }
        CHECK(fmi2.SetReal(c, inputs, N_INPUTS, values) == fmi2OK);
        CHECK(fmi2.DoStep(c, t, h, fmi2True) == fmi2OK);
        CHECK(fmi2.GetReal(c, outputs, N_OUTPUTS, values) == fmi2OK);
        for (int i = 0; i < N_OUTPUTS; i++) {
            write_double(values[i], i + 1 < N_OUTPUTS ? ' ' : '\n');
        }
        t += h;
    }
    CHECK(fmi2.Terminate(c) == fmi2OK);
    fmi2.FreeInstance(c);
    return 0;
}
