/* Drives the FMU from standard input; the same program on every platform.
 *
 * Usage: host LIBRARY. Each line of input is a step: its length, then the values of the inputs in their order.
 * Each line of output holds states and thrust after it. Numbers are the bits of a double in hexadecimal: exact
 * everywhere. */
#include "fmu.h"

#include "bits.h"

enum { N_OUTPUTS = N_STATES + N_OTHER + N_ADDED };

int main(int argc, char *argv[])
{
    static const fmu_host callbacks;
    CHECK(argc == 2);
    load_fmu(argv[1]);
    fmu_instance c = new_instance("rov", &callbacks);
    unsigned inputs[N_INPUTS], outputs[N_OUTPUTS];
    for (unsigned i = 0; i < N_INPUTS; i++) {
        inputs[i] = FIRST_REFERENCE + i;
    }
    for (unsigned i = 0; i < N_OUTPUTS; i++) {
        outputs[i] = FIRST_REFERENCE + (i < N_STATES ? FIRST_STATE : i < N_STATES + N_OTHER ? FIRST_CALCULATED : FIRST_ADDED - N_STATES - N_OTHER) + i;
    }
    double t = 0.0, h, values[N_INPUTS > N_OUTPUTS ? N_INPUTS : N_OUTPUTS];
    while (read_double(&h)) {
        for (int i = 0; i < N_INPUTS; i++) {
            CHECK(read_double(&values[i]));
        }
        CHECK(set_values(c, inputs, N_INPUTS, values) && do_step(c, t, h) && get_values(c, outputs, N_OUTPUTS, values));
        for (int i = 0; i < N_OUTPUTS; i++) {
            write_double(values[i], i + 1 < N_OUTPUTS ? ' ' : '\n');
        }
        t += h;
    }
    CHECK(API.Terminate(c) == 0);
    API.FreeInstance(c);
    return 0;
}
