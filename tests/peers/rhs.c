/* Times right-hand sides as `xtask/bench/src/kernel.rs` does, and speaks the language of the program made from it.
 *
 *     list                      one line a kernel: its name and the number of lanes
 *     check                     reads lines `<kernel> <params>.. <state>..`, prints the derivative for each
 *     time <rounds> <kernel>..  a line `round` after each round, then `<kernel> <min> <median>` in ns
 *     call <n> <kernel>         sweeps n times over the inputs and prints the number of calls
 *
 * Kernels live in shared objects that are opened when they are asked for; `kernels.h` names them:
 *
 *     KERNEL(name, convention, lanes, dimension, object, symbol, parameters..)
 *
 * Knows no right-hand side but the copy of six numbers.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* f(p, t, y, dy), and the two of heyoka: f(dy, y, p, t), the same with the stride of components. */
enum convention { PLAIN, HEYOKA, HEYOKA_STRIDED };
typedef void plain(const double *, double, const double *, double *);
typedef void heyoka(double *, const double *, const double *, const double *);
typedef void heyoka_strided(double *, const double *, const double *, const double *, uint64_t);

enum { SWEEP = 64, MAX_DIMENSION = 16, MAX_PARAMS = 32, MAX_LANES = 8 };
static const double ROUND = 400e-6;

struct kernel {
    const char *name;
    enum convention convention;
    int lanes, dimension;
    const char *object, *symbol;
    int n_params;
    double params[MAX_PARAMS];
    void *call;
    double *prepared, *inputs, *outputs;
    uint64_t n_sweeps;
    double *times;
};

__attribute__((noinline)) static void copy(const double *p, double t, const double *y, double *dy) {
    (void)p, (void)t;
    for (int i = 0; i < 6; i++) dy[i] = y[i];
}

#define COUNT(...) (int)(sizeof((double[]){__VA_ARGS__}) / sizeof(double))
#define KERNEL(name, convention, lanes, dimension, object, symbol, ...)                                            \
    {name, convention, lanes, dimension, object, symbol, COUNT(__VA_ARGS__), {__VA_ARGS__}, NULL, NULL, NULL, NULL, 0, NULL}
static struct kernel kernels[] = {
    {"-/-/copy", PLAIN, 1, 6, NULL, NULL, 0, {0}, NULL, NULL, NULL, NULL, 0, NULL},
#include "kernels.h"
};
enum { N_KERNELS = sizeof kernels / sizeof *kernels };

_Noreturn static void fail(const char *what, const char *which) {
    fprintf(stderr, "%s: %s\n", what, which);
    exit(1);
}

/* SplitMix64 (Steele, Lea, Flood 2014), with the seed of kernel.rs. */
static double between(uint64_t *state, double from, double to) {
    *state += UINT64_C(0x9e3779b97f4a7c15);
    uint64_t z = *state;
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return from + (to - from) * (double)((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
}

static double *numbers(size_t n) {
    double *x = aligned_alloc(64, (n * sizeof *x + 63) / 64 * 64);
    if (!x) fail("out of memory", "numbers");
    memset(x, 0, n * sizeof *x);
    return x;
}

static size_t n_inputs(const struct kernel *k) { return SWEEP / k->lanes; }

/* Parameters of the call: those of a strided kernel stand side by side for all lanes. */
static void set_params(struct kernel *k, const double *params) {
    int copies = k->convention == HEYOKA_STRIDED ? k->lanes : 1;
    for (int i = 0; i < k->n_params; i++)
        for (int l = 0; l < copies; l++) k->prepared[i * copies + l] = params[i];
}

static struct kernel *open_kernel(const char *name) {
    struct kernel *k = kernels;
    while (k < kernels + N_KERNELS && strcmp(k->name, name)) k++;
    if (k == kernels + N_KERNELS) fail("no kernel", name);
    if (k->call) return k;
    k->call = (void *)copy;
    if (k->object) {
        void *library = dlopen(k->object, RTLD_NOW | RTLD_LOCAL);
        k->call = library ? dlsym(library, k->symbol) : NULL;
        if (!k->call) fail(name, dlerror());
    }
    size_t n = n_inputs(k), width = (size_t)k->dimension * k->lanes;
    k->prepared = numbers((size_t)MAX_PARAMS * MAX_LANES);
    k->inputs = numbers(n * width), k->outputs = numbers(n * width);
    set_params(k, k->params);
    uint64_t random = 20261121;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < k->dimension; c++) {
            double x = between(&random, 0.05, 0.95);
            for (int l = 0; l < k->lanes; l++) k->inputs[i * width + (size_t)c * k->lanes + l] = x;
        }
    return k;
}

#define SWEEPS(type, ...)                                                                                          \
    {                                                                                                              \
        type *volatile hidden = (type *)k->call;                                                                   \
        type *f = hidden;                                                                                          \
        for (uint64_t s = 0; s < n; s++) {                                                                         \
            double *dy = k->outputs;                                                                               \
            for (const double *y = k->inputs; y < end; y += width, dy += width) f(__VA_ARGS__);                    \
            __asm__ volatile("" ::: "memory");                                                                     \
        }                                                                                                          \
    }

/* Calls with every input once, n times over, and says how many calls that were. */
__attribute__((noinline)) static uint64_t sweep(struct kernel *k, uint64_t n) {
    const double *p = k->prepared;
    volatile double hidden_t = 0.0;
    const double t = hidden_t;
    size_t width = (size_t)k->dimension * k->lanes;
    const double *end = k->inputs + n_inputs(k) * width;
    switch (k->convention) {
    case PLAIN: SWEEPS(plain, p, t, y, dy) break;
    case HEYOKA: SWEEPS(heyoka, dy, y, p, &t) break;
    case HEYOKA_STRIDED: SWEEPS(heyoka_strided, dy, y, p, &t, (uint64_t)k->lanes) break;
    }
    return n * n_inputs(k);
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static uint64_t sweeps_in(struct kernel *k, double length) {
    for (uint64_t n = 1;; n *= 2) {
        double fastest = 1e9;
        for (int i = 0; i < 5; i++) {
            double start = seconds();
            sweep(k, n);
            double elapsed = seconds() - start;
            if (elapsed < fastest) fastest = elapsed;
        }
        if (8 * fastest > length) {
            double wanted = (double)n * length / fastest + 0.5;
            return wanted < 1.0 ? 1 : (uint64_t)wanted;
        }
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void time_all(int rounds, struct kernel **all, int n) {
    for (int i = 0; i < n; i++) all[i]->n_sweeps = sweeps_in(all[i], ROUND), all[i]->times = numbers((size_t)rounds);
    for (int r = 0; r < rounds; r++) {
        for (int i = 0; i < n; i++) {
            double start = seconds();
            uint64_t calls = sweep(all[i], all[i]->n_sweeps);
            all[i]->times[r] = (seconds() - start) * 1e9 / (double)calls;
        }
        puts("round");
        fflush(stdout);
    }
    for (int i = 0; i < n; i++) {
        qsort(all[i]->times, (size_t)rounds, sizeof(double), ascending);
        printf("%s %.17g %.17g\n", all[i]->name, all[i]->times[0], all[i]->times[rounds / 2]);
    }
}

/* One line: the name up to a tab, then parameters and state. */
static void check(char *line) {
    char *rest = strchr(line, '\t');
    if (!rest) fail("no tab", line);
    *rest++ = 0;
    struct kernel *k = open_kernel(line);
    double params[MAX_PARAMS];
    for (int i = 0; i < k->n_params; i++) params[i] = strtod(rest, &rest);
    set_params(k, params);
    for (int c = 0; c < k->dimension; c++) {
        double x = strtod(rest, &rest);
        for (int l = 0; l < k->lanes; l++) k->inputs[c * k->lanes + l] = x;
    }
    sweep(k, 1);
    /* Lanes must not differ either; the last one is shown. */
    for (int c = 0; c < k->dimension; c++) printf("%.17g ", k->outputs[c * k->lanes + k->lanes - 1]);
    puts("");
    fflush(stdout);
}

int main(int argc, char **argv) {
    const char *task = argc > 1 ? argv[1] : "";
    if (!strcmp(task, "list") && argc == 2) {
        for (int i = 0; i < N_KERNELS; i++) printf("%s %d\n", kernels[i].name, kernels[i].lanes);
    } else if (!strcmp(task, "check") && argc == 2) {
        char line[4096];
        while (fgets(line, sizeof line, stdin)) check(line);
    } else if (!strcmp(task, "time") && argc > 3) {
        int rounds = atoi(argv[2]), n = argc - 3;
        struct kernel **all = calloc((size_t)n, sizeof *all);
        if (!all) fail("out of memory", "kernels");
        for (int i = 0; i < n; i++) all[i] = open_kernel(argv[i + 3]);
        time_all(rounds < 1 ? 1 : rounds, all, n);
    } else if (!strcmp(task, "call") && argc == 4) {
        printf("%llu\n", (unsigned long long)sweep(open_kernel(argv[3]), strtoull(argv[2], NULL, 10)));
    } else {
        fail("started by `cargo xtask bench rhs --peers`, not by hand", task);
    }
    return 0;
}
