// One state of a robot: the functions of its C file against pinocchio's, data reused.
//
//     one_state MODEL ROUNDS      lines "function, ns by C, ns by pinocchio", medians of paired rounds
//
// Compiled by one_state.py with -DROBOT=name -DHEADER="name.h".

#define main loop_main
#include "pinocchio_loop.cpp"
#undef main

#include <algorithm>
#include <array>
#include <cstdlib>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include HEADER

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define OF(name) JOINED(ROBOT, name)

namespace {

double clock_ns()
{
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

template <class F> double ns(F &&f)
{
    const int calls = 2000;
    const double start = clock_ns();
    for (int k = 0; k < calls; k++)
        f(k);
    return (clock_ns() - start) / calls;
}

template <class F, class G> void compare(const char *name, int rounds, F &&ours, G &&theirs)
{
    std::vector<double> a, b;
    for (int k = 0; k < rounds; k++) {
        a.push_back(ns(ours));
        b.push_back(ns(theirs));
    }
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    std::cout << name << " " << a[a.size() / 2] << " " << b[b.size() / 2] << "\n";
}

}  // namespace

int main(int, char **arguments)
{
    const pinocchio::Model model = read_model(arguments[1]);
    pinocchio::Data data(model);
    const int n = model.nv, rounds = std::atoi(arguments[2]);
    Eigen::VectorXd q = Eigen::VectorXd::LinSpaced(n, 0.1, 0.9), qd = 0.5 * q, qdd = 0.3 * q;
    std::vector<double> X(1000, 0.7), S(100000);
    const double *constants = OF(_constants);
    auto moved = [&](int k) { q[0] = 0.1 + 1e-6 * k; };
    compare("inverse_dynamics", rounds,
            [&](int k) { moved(k); OF(_inverse_dynamics1)(q.data(), qd.data(), qdd.data(), X.data(), constants, S.data()); },
            [&](int k) { moved(k); pinocchio::rnea(model, data, q, qd, qdd); });
    compare("inertia_matrix", rounds,
            [&](int k) { moved(k); OF(_inertia_matrix1)(q.data(), X.data(), constants, S.data()); },
            [&](int k) { moved(k); pinocchio::crba(model, data, q, pinocchio::Convention::LOCAL); });
    compare("regressor", rounds,
            [&](int k) { moved(k); OF(_regressor1)(q.data(), qd.data(), qdd.data(), constants, S.data()); },
            [&](int k) { moved(k); pinocchio::computeJointTorqueRegressor(model, data, q, qd, qdd); });
    return 0;
}
