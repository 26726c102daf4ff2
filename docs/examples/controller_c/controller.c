/* A controller at 1 kHz: computed torques of a planar arm with two joints, and a simulated arm whose
   parameters are 10 % larger. No heap; one state at a time.

   symgen generate planar_2r --target c -o .
   cc -std=c99 -Wall -Wextra -pedantic -O2 controller.c planar_2r.c -o controller -lm
   For a microcontroller without double: -DREAL=float for both files. */

#include "planar_2r.h"
#include <math.h>
#include <stdio.h>

enum { JOINTS = PLANAR_2R_JOINTS, PARAMETERS = PLANAR_2R_PARAMETERS, STEPS = 10000 };
static const double PERIOD = 0.001; /* s */

/* Base parameters of the robot file; yours come from `symgen identify`, in the order of
   planar_2r_parameters. */
static const PLANAR_2R_REAL *const X = planar_2r_values;

/* Torques that follow q_r = (sin t, cos 2t): Gamma = A(q) v + C qd + Q + friction, with
   v = qdd_r + 20 (qd_r - qd) + 100 (q_r - q). */
static void control(double t, const PLANAR_2R_REAL *q, const PLANAR_2R_REAL *qd,
                    PLANAR_2R_REAL *tau)
{
    const double q_r[JOINTS] = {sin(t), cos(2*t)}, qd_r[JOINTS] = {cos(t), -2*sin(2*t)};
    const double qdd_r[JOINTS] = {-sin(t), -4*cos(2*t)};
    PLANAR_2R_REAL v[JOINTS];
    for (int j = 0; j < JOINTS; j++)
        v[j] = (PLANAR_2R_REAL)(qdd_r[j] + 20*(qd_r[j] - qd[j]) + 100*(q_r[j] - q[j]));
    planar_2r_inverse_dynamics1(q, qd, v, X, planar_2r_constants, tau);
}

int main(void)
{
    PLANAR_2R_REAL q[JOINTS] = {0, 1}, qd[JOINTS] = {1, 0.5}, qdd[JOINTS], tau[JOINTS];
    PLANAR_2R_REAL J[6*JOINTS], of_arm[PARAMETERS];
    for (int k = 0; k < PARAMETERS; k++)
        of_arm[k] = (PLANAR_2R_REAL)1.1*X[k];
    for (int step = 0; step < STEPS; step++) {
        control(step*PERIOD, q, qd, tau);
        if (planar_2r_forward_dynamics1(q, qd, tau, of_arm, planar_2r_constants, qdd))
            return 1;
        for (int j = 0; j < JOINTS; j++) {
            qd[j] += (PLANAR_2R_REAL)PERIOD*qdd[j];
            q[j] += (PLANAR_2R_REAL)PERIOD*qd[j];
        }
        if (step%100 == 99) {
            planar_2r_jacobian1(2, q, planar_2r_constants, J);
            printf("%.12g %.12g %.12g %.12g %.12g\n", (double)q[0], (double)q[1], (double)tau[0],
                   (double)tau[1], (double)J[0]);
        }
    }
    return 0;
}
