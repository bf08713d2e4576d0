/* Steps a vehicle by its library for MuJoCo, with a stand-in for MuJoCo: one free body and no other forces. The same
 * program runs on every platform, because it calls no function of the mathematics library.
 *
 * Usage: host LIBRARY. The input has 36 entries of the mass matrix of the rigid body, and coefficients and inputs. Each
 * further line has the commands of a step. Each line of output has the pose and the velocity after it. At the end, the
 * stand-in fails twice as MuJoCo does, which must not end the program, nor change the vehicle. Numbers are the
 * bits of a double in hexadecimal: exact everywhere. */
#include "../../fmu/bits.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#include <windows.h>
#define SYMBOL(library, name) ((uintptr_t)(void *)GetProcAddress((HMODULE)(library), name))
#define OPEN(path) ((void *)LoadLibraryA(path))
#else
#include <dlfcn.h>
#define SYMBOL(library, name) ((uintptr_t)dlsym(library, name))
#define OPEN(path) dlopen(path, RTLD_NOW)
#endif

static const double H = 0.002;

typedef struct {
    double M[36], qpos[7], qvel[6], act[20000], ctrl[64], passive[6], xmat[18], rigid[36], time;
    int fails;
} simulation;

static void (*on_error)(const char *);

static void step_1(const void *model, void *data)
{
    simulation *const s = data;
    const double e = s->qpos[3], a = s->qpos[4], b = s->qpos[5], c = s->qpos[6];
    const double R[9] = {1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b - c * e), 2.0 * (a * c + b * e),
                         2.0 * (a * b + c * e), 1.0 - 2.0 * (a * a + c * c), 2.0 * (b * c - a * e),
                         2.0 * (a * c - b * e), 2.0 * (b * c + a * e), 1.0 - 2.0 * (a * a + b * b)};
    (void)model;
    memcpy(s->xmat + 9, R, sizeof R);
    memcpy(s->M, s->rigid, sizeof s->M);
    memset(s->passive, 0, sizeof s->passive);
    if (s->fails) {
        on_error("out of memory");
        abort();
    }
}

static void nothing(const void *model, void *data)
{
    (void)model, (void)data;
}

/* Solve M a = f by Gaussian elimination with the lower half of M, and move the velocity. */
static void step_2(const void *model, void *data)
{
    simulation *const s = data;
    double A[6][7];
    (void)model;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            A[i][j] = i > j ? s->M[6 * i + j] : s->M[6 * j + i];
        }
        A[i][6] = s->passive[i];
    }
    for (int k = 0; k < 6; k++) {
        for (int i = 0; i < 6; i++) {
            const double factor = i == k ? 0.0 : A[i][k] / A[k][k];
            for (int j = k; j < 7; j++) {
                A[i][j] -= factor * A[k][j];
            }
        }
    }
    for (int i = 0; i < 6; i++) {
        s->qvel[i] += H * A[i][6] / A[i][i];
    }
    s->time += H;
}

/* Turn a quaternion, to second order. */
static void turn(double q[4], const double w[3], double h)
{
    const double p = 0.5 * h * w[0], r = 0.5 * h * w[1], s = 0.5 * h * w[2], e = 1.0 - 0.5 * (p * p + r * r + s * s);
    const double next[4] = {e * q[0] - p * q[1] - r * q[2] - s * q[3], e * q[1] + p * q[0] + s * q[2] - r * q[3],
                            e * q[2] + r * q[0] + p * q[3] - s * q[1], e * q[3] + s * q[0] + r * q[1] - p * q[2]};
    memcpy(q, next, sizeof next);
}

static void get_state(const void *model, const void *data, double *state, int which)
{
    (void)model, (void)which;
    *state = ((const simulation *)data)->time;
}

int main(int argc, char *argv[])
{
    static simulation s;
    static const uintptr_t no_callback;
    void *const library = argc == 2 ? OPEN(argv[1]) : NULL;
    if (library == NULL) {
        return 1;
    }
    void (*const sizes)(int *) = (void (*)(int *))SYMBOL(library, "water_sizes");
    void (*const connect)(void *, const uintptr_t *, const int *, const double *) =
        (void (*)(void *, const uintptr_t *, const int *, const double *))SYMBOL(library, "water_connect");
    int (*const step)(void *const *, int, double, int, int, char *, int) =
        (int (*)(void *const *, int, double, int, int, char *, int))SYMBOL(library, "water_step");
    int size[7], places[6 + 21 + 64] = {1, 0, 0, 0, 0, 1000};
    char text[20];
    sizes(size);
    double *const memory = calloc((size_t)size[0], sizeof *memory);
    for (int i = 0; i < 36; i++) {
        if (!read_double(&s.rigid[i])) {
            return 2;
        }
    }
    for (int i = 0; i < size[3] + size[4]; i++) {
        if (!read_double(&memory[size[1] + i])) {
            return 2;
        }
    }
    for (int i = 0, n = 6; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            places[n++] = 6 * i + j;
        }
    }
    for (int i = 0; i < 64; i++) {
        places[6 + 21 + i] = i;
    }
    const uintptr_t none = (uintptr_t)&no_callback;
    const uintptr_t addresses[] = {(uintptr_t)&s, (uintptr_t)&s, (uintptr_t)s.M, (uintptr_t)s.qpos, (uintptr_t)s.qvel,
                                   (uintptr_t)s.act, (uintptr_t)s.ctrl, (uintptr_t)s.passive, (uintptr_t)s.xmat, (uintptr_t)step_1,
                                   (uintptr_t)nothing, (uintptr_t)nothing, (uintptr_t)step_2, (uintptr_t)turn,
                                   (uintptr_t)get_state, (uintptr_t)nothing, (uintptr_t)&on_error, none, none, none, none, none, none, none};
    void *const members[1] = {memory};
    s.qpos[3] = 1.0;
    connect(memory, addresses, places, s.rigid);
    while (size[2] > 0 && read_double(&s.ctrl[0])) {
        for (int i = 1; i < size[2]; i++) {
            if (!read_double(&s.ctrl[i])) {
                return 2;
            }
        }
        if (step(members, 1, H, 0, 1, text, sizeof text) != 0) {
            return 3;
        }
        for (int i = 0; i < 13; i++) {
            write_double(i < 7 ? s.qpos[i] : s.qvel[i - 7], i < 12 ? ' ' : '\n');
        }
    }
    s.fails = 1;
    const simulation before = s;
    for (int i = 0; i < 2; i++) {
        if (step(members, 1, H, 0, 1, text, sizeof text) != 5 || strcmp(text, "out of memory") != 0) {
            return 4;
        }
    }
    return memcmp(before.act, s.act, sizeof s.act) == 0 ? 0 : 5;
}
