// Times the articulated-body algorithm of Pinocchio as `xtask/bench/src/kernel.rs` does, and speaks the language of
// `xtask/src/bench/chains/main.rs`:
//
//     list                      one line a kernel: model/bare/Pinocchio and the number of lanes
//     check                     for each chain lines `<model> <name>=<value>..`: a state of the model and its rates
//     time <rounds> <kernel>..  a line `round` after each round, then `<kernel> <min> <median>` in ns
//     call <n> <kernel>         sweeps n times over the inputs and prints the number of calls
//
// The chains are in the file beside the program whose name ends in .txt, as `xtask/src/bench/chains/family.rs` writes
// it. Coordinates of pendulums are angles in space in their models, and angles of joints here.
#include <pinocchio/multibody.hpp>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/kinematics.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
namespace pin = pinocchio;

enum { SWEEP = 64 };
static const double ROUND = 400e-6;

// SplitMix64 (Steele, Lea, Flood 2014), with the seed of kernel.rs.
struct Random {
    uint64_t state = 20261121;
    double between(double from, double to) {
        state += UINT64_C(0x9e3779b97f4a7c15);
        uint64_t z = state;
        z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
        return from + (to - from) * double((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
    }
};

struct Chain {
    std::string model_name, coordinates;
    std::vector<double> lengths;
    pin::Model model;
    pin::Data data;
    std::vector<VectorXd> q, v, a;
    VectorXd none;

    std::string name() const { return model_name + "/bare/Pinocchio"; }

    uint64_t sweep(uint64_t n) {
        for (uint64_t s = 0; s < n; s++) {
            for (size_t i = 0; i < q.size(); i++) a[i] = pin::aba(model, data, q[i], v[i], none);
            __asm__ volatile("" ::: "memory");
        }
        return n * q.size();
    }
};

[[noreturn]] static void fail(const std::string &what) {
    std::cerr << what << "\n";
    std::exit(1);
}

static std::vector<Chain> read(const std::string &path) {
    std::ifstream file(path);
    std::vector<Chain> chains;
    std::string name, coordinates, joint;
    int n;
    Vector3d gravity, place, centre, moments;
    while (file >> name >> n >> coordinates >> gravity[0] >> gravity[1] >> gravity[2]) {
        Chain chain;
        chain.model_name = name, chain.coordinates = coordinates;
        chain.model.gravity.linear(gravity);
        pin::JointIndex before = 0;
        for (int k = 0; k < n; k++) {
            Matrix3d turn;
            double mass;
            file >> joint >> place[0] >> place[1] >> place[2];
            for (int i = 0; i < 9; i++) file >> turn(i / 3, i % 3);
            file >> mass >> centre[0] >> centre[1] >> centre[2] >> moments[0] >> moments[1] >> moments[2];
            if (!file) fail("the file of chains ends early");
            pin::SE3 placement(turn, place);
            std::string label = "joint" + std::to_string(k);
            before = joint == "universal"
                ? chain.model.addJoint(before, pin::JointModelUniversal(Vector3d::UnitZ(), Vector3d::UnitY()), placement, label)
                : chain.model.addJoint(before, pin::JointModelRZ(), placement, label);
            chain.model.appendBodyToJoint(before, pin::Inertia(mass, centre, moments.asDiagonal()), pin::SE3::Identity());
            chain.lengths.push_back(centre.norm());
        }
        chain.data = pin::Data(chain.model);
        Random random;
        for (int i = 0; i < SWEEP; i++) {
            VectorXd q(chain.model.nq), v(chain.model.nv);
            for (auto &x : q) x = random.between(0.05, 0.95);
            for (auto &x : v) x = random.between(0.05, 0.95);
            chain.q.push_back(q), chain.v.push_back(v), chain.a.push_back(v);
        }
        chain.none = VectorXd::Zero(chain.model.nv);
        chains.push_back(std::move(chain));
    }
    if (chains.empty()) fail(path + " has no chains");
    return chains;
}

static void show(const std::string &name, double value) { std::printf(" %s=%.17g", name.c_str(), value); }

// The first states of a chain, with rates of velocities, in the coordinates of its model.
static void check(Chain &chain) {
    size_t n = chain.lengths.size();
    for (int i = 0; i < 4; i++) {
        const VectorXd &q = chain.q[i], &v = chain.v[i];
        VectorXd a = pin::aba(chain.model, chain.data, q, v, chain.none);
        std::printf("%s", chain.model_name.c_str());
        auto one = [](const std::string &name, double x, double rate, double second) {
            show(name, x), show(name + "_dot", rate), show("d" + name + "_dot", second);
        };
        if (chain.coordinates == "spherical") {
            pin::forwardKinematics(chain.model, chain.data, q, v, a);
            Vector3d end = Vector3d::Zero(), end_v = end, end_a = end;
            for (size_t k = 0; k < n; k++) {
                double l = chain.lengths[k];
                const pin::SE3 &at = chain.data.oMi[k + 1];
                Vector3d tip(0, 0, l);
                Vector3d omega = chain.data.v[k + 1].angular(), turning = chain.data.a[k + 1].angular();
                Vector3d speed = chain.data.v[k + 1].linear() + omega.cross(tip);
                Vector3d second = chain.data.a[k + 1].linear() + turning.cross(tip) + omega.cross(speed);
                Vector3d here = at.act(tip), here_v = at.rotation() * speed, here_a = at.rotation() * second;
                // e = (sin q cos s, sin q sin s, cos q) along the rod, and its derivatives.
                Vector3d e = (here - end) / l, e_dot = (here_v - end_v) / l, e_second = (here_a - end_a) / l;
                double sin_q = std::hypot(e[0], e[1]), cos_q = e[2], cos_s = e[0] / sin_q, sin_s = e[1] / sin_q;
                Vector3d down(cos_q * cos_s, cos_q * sin_s, -sin_q), around(-sin_s, cos_s, 0);
                double q_dot = down.dot(e_dot), s_dot = around.dot(e_dot) / sin_q;
                std::string number = std::to_string(k + 1);
                one("q" + number, std::atan2(sin_q, cos_q), q_dot, down.dot(e_second) + sin_q * cos_q * s_dot * s_dot);
                one("s" + number, std::atan2(sin_s, cos_s), s_dot, (around.dot(e_second) - 2 * cos_q * q_dot * s_dot) / sin_q);
                end = here, end_v = here_v, end_a = here_a;
            }
        } else {
            double x = 0, rate = 0, second = 0;
            for (size_t k = 0; k < n; k++) {
                bool is_sum = chain.coordinates == "planar";
                x = q[k] + (is_sum ? x : 0), rate = v[k] + (is_sum ? rate : 0), second = a[k] + (is_sum ? second : 0);
                one("q" + std::to_string(k + 1), x, rate, second);
            }
        }
        std::printf("\n");
    }
}

static double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

static uint64_t sweeps_in(Chain &chain, double length) {
    for (uint64_t n = 1;; n *= 2) {
        double fastest = 1e9;
        for (int i = 0; i < 5; i++) {
            double start = seconds();
            chain.sweep(n);
            fastest = std::min(fastest, seconds() - start);
        }
        if (8 * fastest > length) return std::max<uint64_t>(1, uint64_t(double(n) * length / fastest + 0.5));
    }
}

static void time_all(int rounds, std::vector<Chain *> all) {
    std::vector<uint64_t> n_sweeps;
    std::vector<std::vector<double>> times(all.size());
    for (Chain *chain : all) n_sweeps.push_back(sweeps_in(*chain, ROUND));
    for (int r = 0; r < rounds; r++) {
        for (size_t i = 0; i < all.size(); i++) {
            double start = seconds();
            uint64_t calls = all[i]->sweep(n_sweeps[i]);
            times[i].push_back((seconds() - start) * 1e9 / double(calls));
        }
        std::puts("round");
        std::fflush(stdout);
    }
    for (size_t i = 0; i < all.size(); i++) {
        std::sort(times[i].begin(), times[i].end());
        std::printf("%s %.17g %.17g\n", all[i]->name().c_str(), times[i][0], times[i][size_t(rounds / 2)]);
    }
}

int main(int argc, char **argv) {
    std::string task = argc > 1 ? argv[1] : "";
    std::vector<Chain> chains = read(std::string(argv[0]) + ".txt");
    auto select = [&](const std::string &name) {
        for (Chain &chain : chains)
            if (chain.name() == name) return &chain;
        fail("no kernel " + name);
    };
    if (task == "list" && argc == 2) {
        for (const Chain &chain : chains) std::printf("%s 1\n", chain.name().c_str());
    } else if (task == "check" && argc == 2) {
        for (Chain &chain : chains) check(chain);
    } else if (task == "time" && argc > 3) {
        std::vector<Chain *> all;
        for (int i = 3; i < argc; i++) all.push_back(select(argv[i]));
        time_all(std::max(1, std::atoi(argv[2])), all);
    } else if (task == "call" && argc == 4) {
        std::printf("%llu\n", (unsigned long long)select(argv[3])->sweep(std::strtoull(argv[2], nullptr, 10)));
    } else {
        fail("started by `cargo xtask bench scaling --peers`, not by hand");
    }
}
