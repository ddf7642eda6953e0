// Times Pinocchio and the code that hamel writes for the same robot: `robots_speed.py` makes the files.
//
//     robots_speed MODEL STATES LIBRARY FRAME
//
// The model is Pinocchio's, as text; STATES has four numbers (states, length of hamel's state, velocities of both) and
// for each state q, v, a of Pinocchio and y, a of hamel; the library has one function for each name in `theirs`, where
// Pinocchio's may stand in two conventions. Rounds take turns; the least time of a call is printed, in nanoseconds.
#include <pinocchio/multibody.hpp>

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/serialization.hpp>

#include <dlfcn.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <string>
#include <utility>
#include <vector>

using Eigen::VectorXd;
namespace pin = pinocchio;

enum { ROUNDS = 40, SWEEPS = 20 };

typedef void (*Call)(const double *y, const double *a, double *out);

static double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int main(int, char **arguments) {
    pin::Model model;
    model.loadFromText(arguments[1]);
    pin::Data data(model);
    std::ifstream file(arguments[2]);
    size_t n, n_state, n_own, n_pin;
    file >> n >> n_state >> n_own >> n_pin;
    if (n_pin != size_t(model.nv)) return 2;
    std::vector<VectorXd> q, v, a, y, own;
    auto read = [&](size_t length) {
        VectorXd x(length);
        for (size_t k = 0; k < length; k++) file >> x[k];
        return x;
    };
    for (size_t i = 0; i < n; i++) {
        q.push_back(read(model.nq));
        v.push_back(read(model.nv));
        a.push_back(read(model.nv));
        y.push_back(read(n_state));
        own.push_back(read(n_own));
    }
    if (!file) return 2;
    void *library = dlopen(arguments[3], RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    pin::FrameIndex frame = model.getFrameId(arguments[4], pin::BODY);
    VectorXd none = VectorXd::Zero(model.nv);
    pin::Data::Matrix6x jacobian(6, model.nv);
    jacobian.setZero();
    std::vector<double> out(1 << 16);
    typedef std::pair<const char *, std::function<void(size_t)>> Pair;
    const pin::Convention local = pin::Convention::LOCAL, world = pin::Convention::WORLD;
    std::vector<Pair> theirs = {
        {"rhs", [&](size_t i) { pin::aba(model, data, q[i], v[i], none, local); }},
        {"rhs", [&](size_t i) { pin::aba(model, data, q[i], v[i], none, world); }},
        {"inverse_dynamics", [&](size_t i) { pin::rnea(model, data, q[i], v[i], a[i]); }},
        {"mass_matrix", [&](size_t i) { pin::crba(model, data, q[i], local); }},
        {"mass_matrix", [&](size_t i) { pin::crba(model, data, q[i], world); }},
        {"gravity", [&](size_t i) { pin::computeGeneralizedGravity(model, data, q[i]); }},
        {"frame_jacobians",
         [&](size_t i) { pin::computeFrameJacobian(model, data, q[i], frame, pin::LOCAL, jacobian); }},
        {"jacobian", [&](size_t i) { pin::computeABADerivatives(model, data, q[i], v[i], none); }},
    };
    std::vector<std::pair<std::string, std::function<void(size_t)>>> kernels;
    std::string before;
    for (const Pair &pair : theirs) {
        Call call = Call(dlsym(library, (std::string("of_hamel_") + pair.first).c_str()));
        if (!call) return 2;
        kernels.push_back({std::string("pinocchio ") + pair.first, pair.second});
        if (pair.first == before) continue;
        before = pair.first;
        kernels.push_back({std::string("hamel ") + pair.first,
                           [=, &y, &own, &out](size_t i) { call(y[i].data(), own[i].data(), out.data()); }});
    }
    std::vector<double> least(kernels.size(), 1e300);
    for (int round = 0; round < ROUNDS; round++) {
        for (size_t k = 0; k < kernels.size(); k++) {
            double start = now();
            for (int sweep = 0; sweep < SWEEPS; sweep++) {
                for (size_t i = 0; i < n; i++) kernels[k].second(i);
                __asm__ volatile("" ::: "memory");
            }
            least[k] = std::min(least[k], (now() - start) * 1e9 / double(SWEEPS * n));
        }
    }
    for (size_t k = 0; k < kernels.size(); k++) printf("%s %.1f\n", kernels[k].first.c_str(), least[k]);
}
