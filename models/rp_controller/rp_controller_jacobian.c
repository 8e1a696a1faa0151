#include "arithmetic_gradient.h"
#include "rp_controller_law_lifted.h"

void rp_controller_integral_jacobian(const struct rp_controller_parameters *p, bool attached,
                                     const struct rp_controller_inputs *inputs, const double w[2],
                                     double rates_by_w[2][2]) {
    const real w_moving[2] = {variable(w[0], 0), variable(w[1], 1)};
    real unlimited[2];
    law_unlimited(&p, attached, &inputs, w_moving, unlimited);
    for (int i = 0; i < 2; i++) {
        const real rate = law_integral_rate(&p, &inputs, unlimited[i], i);
        rates_by_w[i][0] = rate.by[0];
        rates_by_w[i][1] = rate.by[1];
    }
}
