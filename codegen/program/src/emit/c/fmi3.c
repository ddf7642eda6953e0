/* FMI 3.0 for one scene: model exchange, and co-simulation, whose steps fmi3_events.c has.
   What comes before this text says how many numbers of each kind there are, and how they are computed (fmu_..).
   Deliberately does not know: which model it is, how events are found.
   Source: Functional Mock-up Interface Specification 3.0 (Modelica Association, 2022). */

#if defined(_WIN32)
#define FMI3_EXPORT __declspec(dllexport)
#else
#define FMI3_EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef const char *fmi3String;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, double, bool, bool, bool, bool, bool *, double *);

/* Value references, in this order: time, states, derivatives, parameters, outputs, event indicators. */
enum {
    FIRST_STATE = 1,
    FIRST_RATE = FIRST_STATE + FMU_STATE,
    FIRST_PARAM = FIRST_RATE + FMU_STATE,
    FIRST_OUTPUT = FIRST_PARAM + FMU_PARAMS,
    FIRST_EVENT = FIRST_OUTPUT + FMU_OUTPUTS,
    N_REFERENCES = FIRST_EVENT + FMU_EVENTS
};

enum { INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, STEP, TERMINATED };

#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1)

/* What is known of a function of events: that it has a sign; that it is on its level and leaves it, after its own event
   or not; that it is zero, and has its event where it goes on in the direction of that. */
enum { APART, DEPARTS, RESTARTED, STARTS };

typedef struct {
    int phase;
    /* At the last point. */
    double value;
    /* Zero, or the value, zero but for rounding, at which its own event has left it. */
    double level;
    /* Largest magnitude so far. */
    double largest;
    /* To which side of zero it has gone in its last event. */
    double side;
    /* When its event has last changed the state. */
    double last;
    /* Whether that event has turned it back to the side it came from; followed where an importer makes the steps. */
    bool is_turned;
} Watch;

/* What a motion consists of: copied where the state of the FMU is kept. */
typedef struct {
    int mode;
    double t;
    double y[AT_LEAST_ONE(FMU_STATE)];
    double params[AT_LEAST_ONE(FMU_PARAMS)];
    /* Whether the parameters have changed since they were prepared. */
    bool is_stale;
    fmu_prepared prepared;
    Watch watch[AT_LEAST_ONE(FMU_EVENTS)];
    /* The point from which the next step is followed: see fmi3_ranks.c. */
    double t_before;
    double y_before[AT_LEAST_ONE(FMU_STATE)];
    /* When an event has last changed the state. */
    double since;
    /* Events that are closer accumulate. */
    double shortest;
    /* Whether the motion has ended by an event. */
    bool has_ended;
    double tolerance;
    /* The next step of the method. */
    double h;
} Data;

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    bool is_co_simulation;
    Data data;
} Instance;

static fmi3Status fail(Instance *m, const char *message) {
    if (m->log) {
        m->log(m->environment, fmi3Error, "logStatusError", message);
    }
    return fmi3Error;
}

static void start(Data *d) {
    memset(d, 0, sizeof *d);
    d->mode = INSTANTIATED;
    fmu_initial(d->y);
    fmu_params(d->params);
    d->is_stale = true;
    d->tolerance = 1e-8;
    for (int k = 0; k < FMU_EVENTS; k++) {
        d->watch[k].last = -HUGE_VAL;
    }
}

/* All variables. */
static void evaluate(const Data *d, double *all) {
    all[0] = d->t;
    memcpy(all + FIRST_STATE, d->y, FMU_STATE * sizeof(double));
    fmu_rates(&d->prepared, d->t, d->y, all + FIRST_RATE);
    memcpy(all + FIRST_PARAM, d->params, FMU_PARAMS * sizeof(double));
    fmu_outputs(&d->prepared, d->t, d->y, all + FIRST_OUTPUT);
    fmu_events(&d->prepared, d->t, d->y, all + FIRST_EVENT);
}

/* The derivatives of all variables along a direction of all. */
static void differentiate(const Data *d, const double *seeds, double *all) {
    memcpy(all, seeds, FIRST_RATE * sizeof(double));
    memcpy(all + FIRST_PARAM, seeds + FIRST_PARAM, FMU_PARAMS * sizeof(double));
    fmu_tangent(d->params, seeds + FIRST_PARAM, d->t, seeds[0], d->y, seeds + FIRST_STATE, all + FIRST_RATE,
                all + FIRST_OUTPUT, all + FIRST_EVENT);
}

/* Arrays of evaluate may be written past a part that is empty. */
enum { N_ALL = N_REFERENCES + 1 };

/* KEPT */

/* EVENTS */

/* How fast the functions of events change along the motion. */
static void event_rates(const Data *d, double *slopes) {
    double seeds[N_ALL] = {0.0}, all[N_ALL];
    seeds[0] = 1.0;
    fmu_rates(&d->prepared, d->t, d->y, seeds + FIRST_STATE);
    differentiate(d, seeds, all);
    memcpy(slopes, all + FIRST_EVENT, FMU_EVENTS * sizeof(double));
}

FMI3_EXPORT const char *fmi3GetVersion(void) {
    return "3.0";
}

FMI3_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, bool on, size_t n, const fmi3String categories[]) {
    (void)instance, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

static fmi3Instance instantiate(fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                bool is_co_simulation) {
    if (!token || strcmp(token, FMU_TOKEN) != 0) {
        if (log) {
            log(environment, fmi3Error, "logStatusError", "the instantiation token is not that of modelDescription.xml");
        }
        return NULL;
    }
    Instance *m = calloc(1, sizeof *m);
    if (m) {
        m->environment = environment;
        m->log = log;
        m->is_co_simulation = is_co_simulation;
        start(&m->data);
    }
    return m;
}

FMI3_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                      bool visible, bool logging, fmi3InstanceEnvironment environment,
                                                      fmi3LogMessageCallback log) {
    (void)name, (void)resources, (void)visible, (void)logging;
    return instantiate(token, environment, log, false);
}

FMI3_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                                     bool visible, bool logging, bool event_mode, bool early_return,
                                                     const fmi3ValueReference required[], size_t n_required,
                                                     fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                     fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)required, (void)n_required, (void)update;
    return instantiate(token, environment, log, true);
}

FMI3_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                           bool visible, bool logging,
                                                           fmi3InstanceEnvironment environment,
                                                           fmi3LogMessageCallback log,
                                                           void (*clock_update)(fmi3InstanceEnvironment),
                                                           void (*lock)(void), void (*unlock)(void)) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock_update, (void)lock, (void)unlock;
    if (log) {
        log(environment, fmi3Error, "logStatusError", "scheduled execution is not supported");
    }
    return NULL;
}

FMI3_EXPORT void fmi3FreeInstance(fmi3Instance instance) {
    free(instance);
}

FMI3_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, bool tolerance_defined, double tolerance,
                                                   double start_time, bool stop_time_defined, double stop_time) {
    Instance *m = instance;
    (void)stop_time_defined, (void)stop_time;
    if (m->data.mode != INSTANTIATED) {
        return fail(m, "initialization mode is entered once, after instantiation or reset");
    }
    if (tolerance_defined && tolerance > 0.0) {
        m->data.tolerance = tolerance;
    }
    m->data.t = m->data.since = start_time;
    m->data.mode = INITIALIZATION;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    Instance *m = instance;
    if (m->data.mode != INITIALIZATION) {
        return fail(m, "initialization mode was not entered");
    }
    if (ready(m) != fmi3OK) {
        return fmi3Error;
    }
    int code = fmu_domain(&m->data.prepared, m->data.t, m->data.y);
    code = code != 0 ? code : fmu_check(&m->data.prepared, m->data.t, m->data.y);
    if (code != 0) {
        return fail(m, fmu_message(code));
    }
    double nothing[AT_LEAST_ONE(FMU_KEPT)] = {0.0}, residuals[AT_LEAST_ONE(FMU_KEPT)];
    const int broken = kept(&m->data, nothing, residuals);
    if (broken >= 0) {
        return fail(m, fmu_kept_message(broken));
    }
    look_again(&m->data);
    for (int k = 0; k < FMU_EVENTS; k++) {
        if (fmu_is_condition(k) && m->data.watch[k].value < 0.0) {
            return fail(m, fmu_holds_message(k));
        }
    }
    go_on(&m->data);
    m->data.mode = m->is_co_simulation ? STEP : EVENT;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    ((Instance *)instance)->data.mode = EVENT;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3Terminate(fmi3Instance instance) {
    ((Instance *)instance)->data.mode = TERMINATED;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3Reset(fmi3Instance instance) {
    start(&((Instance *)instance)->data);
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                      double values[], size_t n_values) {
    Instance *m = instance;
    double all[N_ALL];
    if (n != n_values) {
        return fail(m, "every variable is one number");
    }
    if (ready(m) != fmi3OK) {
        return fmi3Error;
    }
    evaluate(&m->data, all);
    for (size_t k = 0; k < n; k++) {
        if (references[k] >= N_REFERENCES) {
            return fail(m, "there is no variable of that reference");
        }
        values[k] = all[references[k]];
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                      const double values[], size_t n_values) {
    Instance *m = instance;
    if (n != n_values) {
        return fail(m, "every variable is one number");
    }
    for (size_t k = 0; k < n; k++) {
        const fmi3ValueReference at = references[k];
#ifdef FMU_INPUTS
        /* Inputs, which stand behind the parameters, are set at any time. */
        if (at >= FIRST_OUTPUT - FMU_INPUTS && at < FIRST_OUTPUT) {
            m->data.params[at - FIRST_PARAM] = values[k];
            fmu_hold(m->data.params + FMU_PARAMS - FMU_INPUTS, &m->data.prepared);
            continue;
        }
#endif /* FMU_INPUTS */
        const bool is_param = at >= FIRST_PARAM && at < FIRST_OUTPUT;
        const bool is_between = m->data.mode == EVENT || m->data.mode == STEP;
        if (m->data.mode > INITIALIZATION && !(is_param && is_between)) {
            return fail(m, "states are set until initialization ends, parameters also in event mode and between steps");
        }
        if (at >= FIRST_STATE && at < FIRST_RATE) {
            m->data.y[at - FIRST_STATE] = values[k];
        } else if (is_param) {
            m->data.params[at - FIRST_PARAM] = values[k];
            m->data.is_stale = true;
        } else {
            return fail(m, "a variable that is computed cannot be set");
        }
    }
    return fmi3OK;
}

/* There are no variables of other types. */
#define NO_VARIABLES(Name, type)                                                                                     \
    FMI3_EXPORT fmi3Status fmi3Get##Name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,     \
                                         type values[], size_t n_values) {                                           \
        (void)references, (void)values, (void)n_values;                                                              \
        return n == 0 ? fmi3OK : fail(instance, "all variables are Float64");                                        \
    }                                                                                                                \
    FMI3_EXPORT fmi3Status fmi3Set##Name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,     \
                                         const type values[], size_t n_values) {                                     \
        (void)references, (void)values, (void)n_values;                                                              \
        return n == 0 ? fmi3OK : fail(instance, "all variables are Float64");                                        \
    }

NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(Int32, int32_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool)
NO_VARIABLES(String, fmi3String)

/* What the model has nothing of: binary variables, clocks, intervals, partitions. */
#define NOTHING(Name, ...)                                                                                           \
    FMI3_EXPORT fmi3Status fmi3##Name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,        \
                                      __VA_ARGS__) {                                                                 \
        (void)references;                                                                                            \
        return n == 0 ? fmi3OK : fail(instance, "there are no binary variables and no clocks");                      \
    }

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
NOTHING(GetBinary, size_t sizes[], const uint8_t *values[], size_t n_values)
NOTHING(SetBinary, const size_t sizes[], const uint8_t *const values[], size_t n_values)
NOTHING(GetClock, bool values[])
NOTHING(SetClock, const bool values[])
NOTHING(GetIntervalDecimal, double intervals[], int qualifiers[])
NOTHING(GetIntervalFraction, uint64_t counters[], uint64_t resolutions[], int qualifiers[])
NOTHING(GetShiftDecimal, double shifts[])
NOTHING(GetShiftFraction, uint64_t counters[], uint64_t resolutions[])
NOTHING(SetIntervalDecimal, const double intervals[])
NOTHING(SetIntervalFraction, const uint64_t counters[], const uint64_t resolutions[])
NOTHING(SetShiftDecimal, const double shifts[])
NOTHING(SetShiftFraction, const uint64_t counters[], const uint64_t resolutions[])
NOTHING(GetOutputDerivatives, const int32_t orders[], double values[], size_t n_values)

FMI3_EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, double time) {
    return fail(instance, "scheduled execution is not supported");
}

FMI3_EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference,
                                                           size_t *n) {
    return fail(instance, "dependencies are those of modelDescription.xml");
}

FMI3_EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                                   size_t elements[], fmi3ValueReference independents[],
                                                   size_t elements_of_independents[], int kinds[], size_t n) {
    return fail(instance, "dependencies are those of modelDescription.xml");
}

FMI3_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    Instance *m = instance;
    if (!*state) {
        *state = malloc(sizeof(Data));
    }
    if (!*state) {
        return fail(m, "there is no memory for the state");
    }
    memcpy(*state, &m->data, sizeof(Data));
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    memcpy(&((Instance *)instance)->data, state, sizeof(Data));
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    *size = sizeof(Data);
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, uint8_t bytes[], size_t size) {
    if (size < sizeof(Data)) {
        return fail(instance, "the array is too short for the state");
    }
    memcpy(bytes, state, sizeof(Data));
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const uint8_t bytes[], size_t size,
                                               fmi3FMUState *state) {
    if (size < sizeof(Data)) {
        return fail(instance, "the array is too short for a state");
    }
    if (!*state) {
        *state = malloc(sizeof(Data));
    }
    if (!*state) {
        return fail(instance, "there is no memory for the state");
    }
    memcpy(*state, bytes, sizeof(Data));
    return fmi3OK;
}

/* Whether derivatives by the variable make sense: those of time, states and parameters. */
static bool is_known(fmi3ValueReference at) {
    return at < FIRST_RATE || (at >= FIRST_PARAM && at < FIRST_OUTPUT);
}

static fmi3Status check_references(Instance *m, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                   const fmi3ValueReference knowns[], size_t n_knowns) {
    for (size_t k = 0; k < n_unknowns; k++) {
        if (unknowns[k] >= N_REFERENCES) {
            return fail(m, "there is no variable of that reference");
        }
    }
    for (size_t k = 0; k < n_knowns; k++) {
        if (!is_known(knowns[k])) {
            return fail(m, "derivatives are by time, states and parameters");
        }
    }
    return ready(m);
}

FMI3_EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                    size_t n_unknowns, const fmi3ValueReference knowns[],
                                                    size_t n_knowns, const double seed[], size_t n_seed,
                                                    double sensitivity[], size_t n_sensitivity) {
    Instance *m = instance;
    double seeds[N_ALL] = {0.0}, all[N_ALL];
    if (n_seed != n_knowns || n_sensitivity != n_unknowns) {
        return fail(m, "every variable is one number");
    }
    if (check_references(m, unknowns, n_unknowns, knowns, n_knowns) != fmi3OK) {
        return fmi3Error;
    }
    for (size_t k = 0; k < n_knowns; k++) {
        seeds[knowns[k]] += seed[k];
    }
    differentiate(&m->data, seeds, all);
    for (size_t k = 0; k < n_unknowns; k++) {
        sensitivity[k] = all[unknowns[k]];
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                size_t n_unknowns, const fmi3ValueReference knowns[], size_t n_knowns,
                                                const double seed[], size_t n_seed, double sensitivity[],
                                                size_t n_sensitivity) {
    Instance *m = instance;
    if (n_seed != n_unknowns || n_sensitivity != n_knowns) {
        return fail(m, "every variable is one number");
    }
    if (check_references(m, unknowns, n_unknowns, knowns, n_knowns) != fmi3OK) {
        return fmi3Error;
    }
    for (size_t k = 0; k < n_knowns; k++) {
        double seeds[N_ALL] = {0.0}, all[N_ALL], sum = 0.0;
        seeds[knowns[k]] = 1.0;
        differentiate(&m->data, seeds, all);
        for (size_t i = 0; i < n_unknowns; i++) {
            sum += seed[i] * all[unknowns[i]];
        }
        sensitivity[k] = sum;
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return fail(instance, "there are no structural parameters");
}

FMI3_EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return fail(instance, "there are no structural parameters");
}

FMI3_EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return fmi3OK;
}

/* A function that its own event has turned back, and that a step has left where it was, on its way behind zero again,
   has been on the other side in between: within rounding it has its event now. One that rounding alone has moved behind
   zero, while it goes away from there, has none. */
static fmi3Status look_behind(Instance *m, const double *now) {
    double slopes[AT_LEAST_ONE(FMU_EVENTS)];
    bool may_be = false;
    for (int k = 0; k < FMU_EVENTS; k++) {
        may_be = may_be || m->data.watch[k].phase == RESTARTED || is_change(k, m->data.watch[k].value, now[k]);
    }
    if (!may_be) {
        return fmi3OK;
    }
    event_rates(&m->data, slopes);
    for (int k = 0; k < FMU_EVENTS; k++) {
        Watch *w = &m->data.watch[k];
        const bool is_behind = w->phase == RESTARTED && w->is_turned && w->side * now[k] >= 0.0;
        const bool is_back = is_behind && w->side * slopes[k] > 0.0;
        if (is_back && fabs(now[k] - w->level) > noise(w)) {
            return fail(m, "a step has passed an event that follows another one of its kind: events accumulate, or "
                           "steps are too long for them; let the event end the motion, or take shorter steps");
        }
        if (is_back) {
            w->phase = APART;
            w->value = -w->side;
        }
        const double side = now[k] - w->value;
        const bool is_rounding = fabs(now[k]) <= noise(w) && side * slopes[k] < 0.0;
        if (w->phase == APART && is_change(k, w->value, now[k]) && is_rounding) {
            w->phase = RESTARTED;
            w->is_turned = true;
            w->side = side;
            w->level = now[k];
        }
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, bool *need_update, bool *terminate,
                                                bool *nominals_changed, bool *values_changed, bool *next_defined,
                                                double *next) {
    Instance *m = instance;
    if (ready(m) != fmi3OK) {
        return fmi3Error;
    }
    double now[AT_LEAST_ONE(FMU_EVENTS)], slopes[AT_LEAST_ONE(FMU_EVENTS)], sides[AT_LEAST_ONE(FMU_EVENTS)];
    bool due[AT_LEAST_ONE(FMU_EVENTS)] = {false}, accumulates = false;
    fmu_events(&m->data.prepared, m->data.t, m->data.y, now);
    if (look_behind(m, now) != fmi3OK) {
        return fmi3Error;
    }
    event_rates(&m->data, slopes);
    for (int k = 0; k < FMU_EVENTS; k++) {
        Watch *w = &m->data.watch[k];
        /* One that is zero at the start, and moves in the direction of its event. */
        const bool starts = w->phase == STARTS && now[k] == 0.0 && slopes[k] * fmu_direction(k) > 0.0;
        due[k] = starts || (w->phase == APART && is_change(k, w->value, now[k]));
        sides[k] = starts ? slopes[k] : now[k] - w->value;
        w->side = due[k] ? sides[k] : w->side;
        w->phase = starts ? APART : w->phase;
    }
    *values_changed = carry_out(&m->data, due, sides, &accumulates);
    if (accumulates) {
        return fail(m, "events accumulate: one changes the state again within the rounding of time; let it end the "
                       "motion");
    }
    if (*values_changed) {
        event_rates(&m->data, slopes);
    }
    go_on(&m->data);
    for (int k = 0; k < FMU_EVENTS; k++) {
        Watch *w = &m->data.watch[k];
        if (*values_changed && w->phase == RESTARTED) {
            w->is_turned = due[k] && sides[k] * slopes[k] < 0.0;
        }
    }
    *terminate = m->data.has_ended;
    *need_update = *nominals_changed = *next_defined = false;
    *next = 0.0;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    ((Instance *)instance)->data.mode = CONTINUOUS;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, bool no_set_before, bool *enter_event_mode,
                                                   bool *terminate) {
    Instance *m = instance;
    double now[AT_LEAST_ONE(FMU_EVENTS)];
    if (ready(m) != fmi3OK) {
        return fmi3Error;
    }
    if (passes(&m->data, m->data.t, m->data.y, true)) {
        return fail(m, passed);
    }
    go_on(&m->data);
    fmu_events(&m->data.prepared, m->data.t, m->data.y, now);
    if (look_behind(m, now) != fmi3OK) {
        return fmi3Error;
    }
    *enter_event_mode = *terminate = false;
    for (int k = 0; k < FMU_EVENTS; k++) {
        const Watch *w = &m->data.watch[k];
        *enter_event_mode = *enter_event_mode || (w->phase == APART && is_change(k, w->value, now[k]));
    }
    if (!*enter_event_mode) {
        pass(&m->data, now);
        for (int k = 0; k < FMU_EVENTS; k++) {
            Watch *w = &m->data.watch[k];
            /* What has just been zero has no sign before it has left its level, and zero where it was turned back. */
            const bool is_behind = w->phase == RESTARTED && w->is_turned && w->side * now[k] >= 0.0;
            w->phase = now[k] != w->level && !is_behind ? APART : w->phase;
        }
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SetTime(fmi3Instance instance, double time) {
    ((Instance *)instance)->data.t = time;
    return fmi3OK;
}

/* A number of states or indicators that is not the model's. */
static fmi3Status expect_number(Instance *m, size_t n, size_t expected) {
    return n == expected ? ready(m) : fail(m, "the number of values is not that of the model");
}

FMI3_EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const double states[], size_t n) {
    Instance *m = instance;
    if (expect_number(m, n, FMU_STATE) != fmi3OK) {
        return fmi3Error;
    }
    memcpy(m->data.y, states, n * sizeof(double));
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, double derivatives[], size_t n) {
    Instance *m = instance;
    if (expect_number(m, n, FMU_STATE) != fmi3OK) {
        return fmi3Error;
    }
    fmu_rates(&m->data.prepared, m->data.t, m->data.y, derivatives);
    for (size_t k = 0; k < n; k++) {
        if (!isfinite(derivatives[k])) {
            /* A solver tries a shorter step. */
            return fmi3Discard;
        }
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance instance, double indicators[], size_t n) {
    Instance *m = instance;
    double now[AT_LEAST_ONE(FMU_EVENTS)];
    if (expect_number(m, n, FMU_EVENTS) != fmi3OK) {
        return fmi3Error;
    }
    fmu_events(&m->data.prepared, m->data.t, m->data.y, now);
    memcpy(indicators, now, n * sizeof(double));
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance instance, double states[], size_t n) {
    Instance *m = instance;
    if (expect_number(m, n, FMU_STATE) != fmi3OK) {
        return fmi3Error;
    }
    memcpy(states, m->data.y, n * sizeof(double));
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, double nominals[], size_t n) {
    Instance *m = instance;
    if (n != FMU_STATE) {
        return fail(m, "the number of values is not that of the model");
    }
    for (size_t k = 0; k < n; k++) {
        nominals[k] = 1.0;
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n) {
    *n = FMU_EVENTS;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n) {
    *n = FMU_STATE;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    ((Instance *)instance)->data.mode = STEP;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, double time, double size, bool no_set_before,
                                  bool *event_handling, bool *terminate, bool *early_return, double *last_time) {
    Instance *m = instance;
    *event_handling = *early_return = false;
    fmi3Status status = ready(m);
    if (status == fmi3OK && !(size > 0.0)) {
        status = fail(m, "the communication step is not positive");
    }
    if (status == fmi3OK) {
        status = advance(m, time + size);
    }
    *terminate = m->data.has_ended;
    *last_time = m->data.t;
    return status;
}
