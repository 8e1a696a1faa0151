#include "bench.h"

#include <malloc.h>

void measure_life(struct bench *bench) {
    enum { LIVES = 100 };
    struct problem *problem = problem_create(1e-3, 1, INPUTS_CHANGING);
    double us[METHODS][MOST_REPEATS];
    for (int repeat = 0; repeat < bench->repeats; repeat++) {
        for (enum method method = FIRST_METHOD; method < METHODS; method++) {
            const double begin = processor_time();
            for (int life = 0; life < LIVES; life++) {
                bench->fmu.FreeInstance(fmu_start(&bench->fmu, problem, method, 1e-8));
            }
            us[method][repeat] = 1e6 * (processor_time() - begin) / LIVES;
        }
    }
    for (enum method method = FIRST_METHOD; method < METHODS; method++) {
        double state[4];
        const size_t before = mallinfo2().uordblks;
        fmi2Component c = fmu_start(&bench->fmu, problem, method, 1e-8);
        fmu_step(&bench->fmu, c, problem, 0, state);
        const double kib = (double)(mallinfo2().uordblks - before) / 1024.0;
        bench->fmu.FreeInstance(c);
        const double life = median(us[method], bench->repeats);
        report_row(&bench->report, "life", "instantiate to free", method_names[method]);
        report_judged(&bench->report, "us", life, 30.0);
        report_row_end(&bench->report);
        report_row(&bench->report, "life", "memory of an instance after a step",
                   method_names[method]);
        report_judged(&bench->report, "kib", kib, 32.0);
        report_row_end(&bench->report);
    }
    problem_destroy(problem);
}
