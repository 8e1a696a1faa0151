#define _GNU_SOURCE // pthread_attr_setaffinity_np

#include "bench.h"

#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>

/* Instance i has start i % STARTS, so that any number of instances computes the same motions, in
 * another order. */
enum { STARTS = 1000, STEPS = 10, COUNTS = 5 };

/* s for a communication step, with count instances stepped in turn; in groups until every start has
 * been used as often as any other. */
static double step_in_turn(const struct fmu_functions *fmu, struct problem *problems[],
                           enum method method, int count, fmi2Component instances[],
                           double states[][STEPS][4]) {
    const int total = count > STARTS ? count : STARTS;
    const double clock = clock_cost(processor_time);
    double seconds = 0.0;
    for (int first = 0; first < total; first += count) {
        for (int i = 0; i < count; i++) {
            instances[i] = fmu_start(fmu, problems[(first + i) % STARTS], method, 1e-8);
        }
        const double begin = processor_time();
        for (int step = 0; step < STEPS; step++) {
            for (int i = 0; i < count; i++) {
                const int start = (first + i) % STARTS;
                fmu_step(fmu, instances[i], problems[start], step, states[start][step]);
            }
        }
        seconds += processor_time() - begin - clock;
        for (int i = 0; i < count; i++) {
            fmu->FreeInstance(instances[i]);
        }
    }
    return seconds / total / STEPS;
}

static double largest_error(struct problem *problems[], double states[][STEPS][4]) {
    double error = 0.0;
    for (int i = 0; i < STARTS; i++) {
        error = fmax(error, problem_error(problems[i], states[i]));
    }
    return error;
}

static void measure_counts(struct bench *bench, struct problem *problems[], enum method method,
                           double most_more_us) {
    static const int counts[COUNTS] = {1, 10, 100, 1000, 10000};
    const int measured = bench->quick ? COUNTS - 1 : COUNTS;
    fmi2Component *instances = allocate(10000, sizeof instances[0]);
    double(*states)[STEPS][4] = allocate(STARTS, sizeof states[0]);
    double us[COUNTS][MOST_REPEATS];
    double errors[COUNTS] = {0.0};
    for (int repeat = 0; repeat < bench->repeats; repeat++) {
        for (int i = 0; i < measured; i++) {
            us[i][repeat] =
                1e6 * step_in_turn(&bench->fmu, problems, method, counts[i], instances, states);
            errors[i] = largest_error(problems, states);
        }
    }
    for (int i = 0; i < measured; i++) {
        double more[MOST_REPEATS];
        double ratio[MOST_REPEATS];
        for (int repeat = 0; repeat < bench->repeats; repeat++) {
            more[repeat] = us[i][repeat] - us[0][repeat];
            ratio[repeat] = us[i][repeat] / us[0][repeat];
        }
        char work[64];
        snprintf(work, sizeof work, "%d instances in turn", counts[i]);
        report_row(&bench->report, "instances", work, method_names[method]);
        report_number(&bench->report, "instances", counts[i]);
        report_number(&bench->report, "us", median(us[i], bench->repeats));
        report_number(&bench->report, "ratio", median(ratio, bench->repeats));
        report_number(&bench->report, "error", errors[i]);
        report_judged(&bench->report, "more_us", median(more, bench->repeats),
                      (struct target){counts[i] == 10000 ? AT_MOST : NO_TARGET, most_more_us});
        report_row_end(&bench->report);
    }
    free(states);
    free(instances);
}

void measure_instances(struct bench *bench) {
    struct problem *problems[STARTS];
    for (int i = 0; i < STARTS; i++) {
        problems[i] = problem_create(1e-3, STEPS, INPUTS_CHANGING, 1e-4 * i);
    }
    measure_counts(bench, problems, CVODE_ADAMS, 2.0);
    measure_counts(bench, problems, ERK, 2.0);
    measure_counts(bench, problems, TAYLOR, 0.5);
    for (int i = 0; i < STARTS; i++) {
        problem_destroy(problems[i]);
    }
}

/* ---- Threads -------------------------------------------------------------------------------- */

struct worker {
    const struct fmu_functions *fmu;
    const struct problem *problem;
    enum method method;
    int rounds;
    pthread_barrier_t *start;
    double begin;
    double end;
    double processor; /* time that a core worked for it, s */
    double error;
};

static void *run_worker(void *argument) {
    struct worker *worker = argument;
    struct fmu_counts counts;
    double(*states)[4] = allocate((size_t)worker->problem->steps, sizeof states[0]);
    pthread_barrier_wait(worker->start);
    worker->begin = now();
    for (int round = 0; round < worker->rounds; round++) {
        fmu_run(worker->fmu, worker->problem, worker->method, 1e-8, states, &counts);
    }
    worker->end = now();
    worker->processor = processor_time();
    worker->error = problem_error(worker->problem, states);
    free(states);
    return NULL;
}

/* Thread 0 runs on the first processor that the program may use, thread 1 on the last one (those
 * next to each other are often one core). */
static void create_on_own_core(pthread_t *thread, int index, struct worker *worker) {
    cpu_set_t allowed;
    cpu_set_t own;
    pthread_attr_t attributes;
    require(sched_getaffinity(0, sizeof allowed, &allowed) == 0, "no processors");
    size_t chosen = CPU_SETSIZE;
    for (size_t i = 0; i < CPU_SETSIZE && (index > 0 || chosen == CPU_SETSIZE); i++) {
        chosen = CPU_ISSET(i, &allowed) ? i : chosen;
    }
    CPU_ZERO(&own);
    CPU_SET(chosen, &own);
    require(pthread_attr_init(&attributes) == 0 &&
                pthread_attr_setaffinity_np(&attributes, sizeof own, &own) == 0 &&
                pthread_create(thread, &attributes, run_worker, worker) == 0,
            "no thread");
    pthread_attr_destroy(&attributes);
}

/* s from the first thread's begin to the last one's end; processor: s that a core worked for one,
 * on average */
static double run_threads(struct worker workers[2], const struct worker *like, int count,
                          double *processor) {
    pthread_t threads[2];
    pthread_barrier_t start;
    double begin = INFINITY;
    double end = 0.0;
    pthread_barrier_init(&start, NULL, (unsigned)count);
    for (int i = 0; i < count; i++) {
        workers[i] = *like;
        workers[i].start = &start;
        create_on_own_core(&threads[i], i, &workers[i]);
    }
    *processor = 0.0;
    for (int i = 0; i < count; i++) {
        pthread_join(threads[i], NULL);
        begin = fmin(begin, workers[i].begin);
        end = fmax(end, workers[i].end);
        *processor += workers[i].processor;
    }
    pthread_barrier_destroy(&start);
    *processor /= count;
    return end - begin;
}

static void measure_two(struct bench *bench, const struct problem *problem, enum method method,
                        int rounds) {
    const struct worker like = {.fmu = &bench->fmu,
                                .problem = problem,
                                .method = method,
                                .rounds = bench->quick ? 1 : rounds};
    double throughput[MOST_REPEATS];
    double undisturbed[MOST_REPEATS]; // the same if no thread had to wait for its core
    double shares[MOST_REPEATS];
    struct worker workers[2] = {{0}};
    for (int repeat = 0; repeat < bench->repeats; repeat++) {
        double worked_one;
        double worked_two;
        const double one = run_threads(workers, &like, 1, &worked_one);
        const double two = run_threads(workers, &like, 2, &worked_two);
        throughput[repeat] = 2.0 * one / two;
        undisturbed[repeat] = 2.0 * worked_one / worked_two;
        shares[repeat] = worked_two / two;
    }
    const double error = fmax(workers[0].error, workers[1].error);
    report_row(&bench->report, "threads", "two threads with an instance each",
               method_names[method]);
    report_number(&bench->report, "processor_share", median(shares, bench->repeats));
    report_number(&bench->report, "undisturbed", median(undisturbed, bench->repeats));
    report_number(&bench->report, "error", error);
    report_judged(&bench->report, "throughput", median(throughput, bench->repeats),
                  (struct target){AT_LEAST, 1.8});
    report_row_end(&bench->report);
}

void measure_threads(struct bench *bench) {
    struct problem *problem = problem_create(1e-3, 2000, INPUTS_CHANGING, 0.0);
    measure_two(bench, problem, CVODE_ADAMS, 5);
    measure_two(bench, problem, ERK, 30);
    measure_two(bench, problem, TAYLOR, 100);
    problem_destroy(problem);
}
