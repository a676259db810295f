/* How fast the virtual board is: motor seconds per second of wall time on one core, with the linked firmware or without work in it. */
#include "vboard.h"

#include <stdio.h>
#include <time.h>

static double wall_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(void)
{
    enum { CHUNKS = 200,
           PERIODS = 1000 };
    vb_t *vb = vb_create();
    if (vb == NULL || vb_power_up(vb) != 0) {
        fprintf(stderr, "foc33: the board could not be started, bench: check the build\n");
        return 2;
    }
    vb_set(vb, "input.pot", 0.5);
    vb_run(vb, 4000);
    vb_set(vb, "input.s2", 1.0);
    vb_run(vb, 4000);
    vb_set(vb, "input.s2", 0.0);
    vb_run(vb, 60000);
    double time_s = 0.0, start_s = 0.0;
    vb_get(vb, "time_s", &start_s);
    vb_trace_config(vb, "time_s,plant.i_a,plant.theta_e_deg,plant.speed_rpm", 10);
    double begin_s = wall_s();
    for (int n = 0; n < CHUNKS; n++) {
        vb_run(vb, PERIODS);
    }
    double took_s = wall_s() - begin_s;
    double speed_rpm = 0.0;
    vb_get(vb, "time_s", &time_s);
    vb_get(vb, "state.speed_rpm", &speed_rpm);
    printf("virtual board: %.1f s of motor time per second, %.2f us per PWM period, shaft at %.0f rpm\n", (time_s - start_s) / took_s,
           took_s / (CHUNKS * PERIODS) * 1e6, speed_rpm);
    vb_destroy(vb);
    return 0;
}
