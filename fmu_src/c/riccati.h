/* Exact motion of one axis under a held force: v' = C - B v - A |v| v with A, B >= 0.
 * The same formulas as rov_fmu/motion/riccati.py, which derives them. No state, no allocation, no errno. */
#ifndef RICCATI_H
#define RICCATI_H

typedef struct {
    double A; /* quadratic drag, 1/m (1/rad) */
    double B; /* linear drag, 1/s */
    double C; /* force, m/s2 (rad/s2) */
} riccati;

/* v(h) from v0 into *v and the integral of v from 0 to h into *s, h > 0; either may be NULL. */
static inline void riccati_advance(const riccati *axis, double v0, double h, double *v, double *s);

/* One of the two. */
static double riccati_velocity(const riccati *axis, double v0, double h);
static double riccati_distance(const riccati *axis, double v0, double h);

/* When the force brings v0 to rest and turns it; infinite where it does not. */
static double riccati_turning_time(const riccati *axis, double v0);

/* v' at v. */
static double riccati_acceleration(const riccati *axis, double v);

#endif
