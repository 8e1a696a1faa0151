/* How near a path comes to the axis of joint 1. README.md derives it. */
#pragma once

#include "../real.h"
#include "rp_trajectory_values.h"

/* A point of a path (m, frame 0), and its distance (m) from the axis of joint 1. */
struct near_point {
    real x, y, distance;
};

static inline struct near_point near_point(real x, real y) {
    return (struct near_point){x, y, sqrt(x * x + y * y)};
}

static inline struct near_point nearest_of_line(const struct rp_trajectory_parameters *p) {
    const real way_x = p->ee_x_to - p->ee_x_from, way_y = p->ee_y_to - p->ee_y_from;
    const real way2 = way_x * way_x + way_y * way_y;
    const real back = -(way_x * p->ee_x_from + way_y * p->ee_y_from);
    if (back <= 0.0) {
        return near_point(p->ee_x_from, p->ee_y_from);
    }
    if (back >= way2) {
        return near_point(p->ee_x_to, p->ee_y_to);
    }
    const real area = way_x * p->ee_y_from - way_y * p->ee_x_from;
    return (struct near_point){-area * way_y / way2, area * way_x / way2, fabs(area) / sqrt(way2)};
}

static inline struct near_point point_of_circle(const struct rp_trajectory_parameters *p,
                                                real angle) {
    return near_point(p->x_center + p->radius * cos(angle), p->y_center + p->radius * sin(angle));
}

/* Of the arc from start_angle on, turns long. */
static inline struct near_point nearest_of_circle(const struct rp_trajectory_parameters *p) {
    const real circle = 6.28318530717958647693;
    const real direction = p->frequency < 0.0 ? -1.0 : 1.0;
    const real center = sqrt(p->x_center * p->x_center + p->y_center * p->y_center);
    const struct near_point start = point_of_circle(p, p->start_angle);
    if (center == 0.0) {
        return (struct near_point){start.x, start.y, p->radius};
    }
    const real to_axis = atan2(-p->y_center, -p->x_center);
    const real ahead = direction * (to_axis - p->start_angle) / circle;
    if (ahead - floor(value_of(ahead)) <= p->turns) { // the arc sweeps the direction to the axis
        const real beyond_axis = 1.0 - p->radius / center;
        return (struct near_point){beyond_axis * p->x_center, beyond_axis * p->y_center,
                                   fabs(center - p->radius)};
    }
    const struct near_point end =
        point_of_circle(p, p->start_angle + direction * circle * p->turns);
    return end.distance < start.distance ? end : start;
}

/* The nearest point of the line or the swept arc; of the arc for point_to_point, too, every point
 * of which can be reached. */
static inline struct near_point nearest_of_path(const struct rp_trajectory_parameters *p) {
    return p->motion == RP_TRAJECTORY_MOTION_LINE ? nearest_of_line(p) : nearest_of_circle(p);
}
