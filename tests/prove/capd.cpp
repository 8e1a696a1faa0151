/* Encloses a free motion of the arm with CAPD 6.1 (capd.ii.uj.edu.pl), for comparison with `prove`:
 *
 *     pip download --no-deps uj-capdpy==0.5.1 && tar xf uj_capdpy-0.5.1.tar.gz
 *     cmake -S uj_capdpy-0.5.1/lib/CAPD -B capd -DCAPD_ENABLE_MULTIPRECISION=OFF
 *     cmake --build capd -j 2
 *
 * Arguments: end in s, order. Prints bounds of q1, q2, dq1, dq2, the largest radius and the
 * processor time in s. */
#include "capd/capdlib.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>

using capd::interval;

int main(int, char *arguments[]) {
    const std::string equations =
        "par:F,m2,l1,ml,a,g;var:q1,q2,w,v;fun:w,v,"
        "(a*m2*(l1+q2)*w^2-g*(ml+m2*(l1+q2))*cos(q1)-2*m2*(l1+q2)*v*w)/(F+m2*(l1+q2)^2),"
        "a*(a*m2*(l1+q2)*w^2-g*(ml+m2*(l1+q2))*cos(q1)-2*m2*(l1+q2)*v*w)/(F+m2*(l1+q2)^2)"
        "+(l1+q2)*w^2-g*sin(q1);";
    const std::clock_t begin = std::clock();
    capd::IMap field(equations);
    const interval m1 = 2.0, lc1 = 0.25;
    field.setParameter("F", m1 * lc1 * lc1 + interval(0.1) + interval(0.05));
    field.setParameter("m2", interval(1.0));
    field.setParameter("l1", interval(0.5));
    field.setParameter("ml", m1 * lc1);
    field.setParameter("a", interval(0.1));
    field.setParameter("g", interval(9.81));
    capd::IOdeSolver solver(field, std::atoi(arguments[2]));
    solver.setAbsoluteTolerance(1e-16);
    solver.setRelativeTolerance(1e-16);
    capd::ITimeMap motion(solver);
    capd::IVector start(4);
    start[0] = 0.3;
    start[1] = 0.2;
    capd::C0HORect2Set set(start);
    const capd::IVector end = motion(interval(std::atof(arguments[1])), set);
    double radius = 0.0;
    for (const interval &x : end) {
        std::printf("%.17g %.17g\n", x.leftBound(), x.rightBound());
        radius = std::max(radius, (x.rightBound() - x.leftBound()) / 2.0);
    }
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    std::printf("radius %.2g, %.3f s\n", radius, seconds);
}
