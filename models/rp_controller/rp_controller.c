#include "rp_controller.h"

#include "arithmetic_double.h"
#include "rp_controller_law.h"

void rp_controller_unlimited(const struct rp_controller_parameters *p, bool attached,
                             const struct rp_controller_inputs *inputs, const double w[2],
                             double unlimited[2]) {
    law_unlimited(&p, attached, &inputs, w, unlimited);
}

void rp_controller_limited(const struct rp_controller_parameters *p, const double unlimited[2],
                           double effort[2]) {
    for (int i = 0; i < 2; i++) {
        effort[i] = law_limited(&p, unlimited[i], i);
    }
}

void rp_controller_integral_rates(const struct rp_controller_parameters *p,
                                  const struct rp_controller_inputs *inputs,
                                  const double unlimited[2], double rates[2]) {
    for (int i = 0; i < 2; i++) {
        rates[i] = law_integral_rate(&p, &inputs, unlimited[i], i);
    }
}
