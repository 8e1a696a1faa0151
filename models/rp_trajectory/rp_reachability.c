#include "rp_trajectory.h"

#include <math.h>

static const double two_pi = 6.28318530717958647693;

static double length(const double v[2]) {
    return sqrt(v[0] * v[0] + v[1] * v[1]);
}

static double nearest_of_line(const struct rp_trajectory_parameters *p, double nearest[2]) {
    const double way[2] = {p->ee_to[0] - p->ee_from[0], p->ee_to[1] - p->ee_from[1]};
    const double way2 = way[0] * way[0] + way[1] * way[1];
    const double back = -(way[0] * p->ee_from[0] + way[1] * p->ee_from[1]);
    if (back <= 0.0) {
        nearest[0] = p->ee_from[0];
        nearest[1] = p->ee_from[1];
        return length(nearest);
    }
    if (back >= way2) {
        nearest[0] = p->ee_to[0];
        nearest[1] = p->ee_to[1];
        return length(nearest);
    }
    const double area = way[0] * p->ee_from[1] - way[1] * p->ee_from[0];
    nearest[0] = -area * way[1] / way2;
    nearest[1] = area * way[0] / way2;
    return fabs(area) / sqrt(way2);
}

static void point_of_circle(const struct rp_trajectory_parameters *p, double angle,
                            double point[2]) {
    point[0] = p->center[0] + p->radius * cos(angle);
    point[1] = p->center[1] + p->radius * sin(angle);
}

/* Whether the arc from start_angle on, turns long, sweeps angle. */
static bool is_swept(const struct rp_trajectory_parameters *p, double angle) {
    const double direction = p->frequency < 0.0 ? -1.0 : 1.0;
    const double ahead = direction * (angle - p->start_angle) / two_pi;
    return ahead - floor(ahead) <= p->turns;
}

static double nearest_of_circle(const struct rp_trajectory_parameters *p, double nearest[2]) {
    const double center = length(p->center);
    const double to_axis = atan2(-p->center[1], -p->center[0]);
    if (center == 0.0) {
        point_of_circle(p, p->start_angle, nearest);
        return p->radius;
    }
    if (is_swept(p, to_axis)) {
        const double beyond_axis = 1.0 - p->radius / center;
        nearest[0] = beyond_axis * p->center[0];
        nearest[1] = beyond_axis * p->center[1];
        return fabs(center - p->radius);
    }
    double end[2];
    const double direction = p->frequency < 0.0 ? -1.0 : 1.0;
    point_of_circle(p, p->start_angle, nearest);
    point_of_circle(p, p->start_angle + direction * two_pi * p->turns, end);
    if (length(end) < length(nearest)) {
        nearest[0] = end[0];
        nearest[1] = end[1];
    }
    return length(nearest);
}

double rp_trajectory_distance(const struct rp_trajectory_parameters *p, double nearest[2]) {
    nearest[0] = nearest[1] = 0.0;
    switch ((enum rp_trajectory_motion)p->motion) {
    case RP_TRAJECTORY_POINT_TO_POINT:
        return INFINITY;
    case RP_TRAJECTORY_LINE:
        return nearest_of_line(p, nearest);
    case RP_TRAJECTORY_CIRCLE:
        return nearest_of_circle(p, nearest);
    }
    return INFINITY;
}

enum rp_trajectory_fault rp_trajectory_check(const struct rp_trajectory_parameters *p) {
    if (p->motion == RP_TRAJECTORY_CIRCLE) {
        if (p->frequency == 0.0) {
            return RP_TRAJECTORY_NO_FREQUENCY;
        }
        if (!(p->turns / fabs(p->frequency) >= p->ramp_time)) {
            return RP_TRAJECTORY_SHORT_TURNS;
        }
    }
    if (!(p->release_time >= p->grasp_time)) {
        return RP_TRAJECTORY_EARLY_RELEASE;
    }
    double nearest[2];
    return rp_trajectory_distance(p, nearest) > fabs(p->a) ? RP_TRAJECTORY_VALID
                                                           : RP_TRAJECTORY_OUT_OF_REACH;
}

bool rp_trajectory_is_attached(const struct rp_trajectory_parameters *p, double t) {
    return p->grasp_time <= t && t < p->release_time;
}
