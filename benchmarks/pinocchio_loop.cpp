// The peer of pinocchio_loop.py: pinocchio's computeJointTorqueRegressor over the samples of a record, data reused, from C++.
//
//     pinocchio_loop MODEL STATES W
//
// MODEL, text: number of joints; gravity; then per joint 1 if it slides, rotation by rows and origin of its frame at q = 0 in the frame before.
// STATES, float64: N as int64, then q, qd, qdd, each (N, n). Requests on standard input, one a line:
//     keep k      W filled k times; answer: CPU seconds of one time
//     calls k     the same calls, results left in `data`
//     save        W to its file, float64, columns of n*N entries, joint-major: W[c][j*N + t]
// Row j holds the columns of links j to n only; the others are zero and written once.

#include <cstdint>
#include <ctime>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/multibody.hpp>

namespace {

pinocchio::Model read_model(const std::string &path)
{
    std::ifstream file(path);
    pinocchio::Model model;
    int joints = 0;
    Eigen::Vector3d gravity;
    file >> joints >> gravity.x() >> gravity.y() >> gravity.z();
    model.gravity.linear() = gravity;
    for (int j = 1; j <= joints; j++) {
        int slides = 0;
        Eigen::Matrix3d R;
        Eigen::Vector3d p;
        file >> slides;
        for (int k = 0; k < 9; k++)
            file >> R(k / 3, k % 3);
        file >> p.x() >> p.y() >> p.z();
        const auto parent = static_cast<pinocchio::JointIndex>(j - 1);
        const std::string name = "joint" + std::to_string(j);
        if (slides)
            model.addJoint(parent, pinocchio::JointModelPZ(), pinocchio::SE3(R, p), name);
        else
            model.addJoint(parent, pinocchio::JointModelRZ(), pinocchio::SE3(R, p), name);
    }
    return model;
}

struct Loop {
    pinocchio::Model model;
    pinocchio::Data data;
    Eigen::Index n;
    std::int64_t N = 0;
    Eigen::MatrixXd q, qd, qdd;  // (n, N): one column a sample
    std::vector<double> W;

    Loop(const std::string &path, const std::string &states) : model(read_model(path)), data(model), n(model.nv)
    {
        std::ifstream file(states, std::ios::binary);
        file.read(reinterpret_cast<char *>(&N), sizeof N);
        for (Eigen::MatrixXd *x : {&q, &qd, &qdd}) {
            x->resize(n, N);
            file.read(reinterpret_cast<char *>(x->data()), static_cast<std::streamsize>(sizeof(double)) * n * N);
        }
        W.assign(static_cast<std::size_t>(n * N * 10 * n), 0.0);
        if (!file)
            throw std::runtime_error("states cannot be read");
    }

    void run(bool keep)
    {
        Eigen::VectorXd q_t(n), qd_t(n), qdd_t(n);
        for (std::int64_t t = 0; t < N; t++) {
            q_t = q.col(t);
            qd_t = qd.col(t);
            qdd_t = qdd.col(t);
            const auto &D = pinocchio::computeJointTorqueRegressor(model, data, q_t, qd_t, qdd_t);
            if (keep)
                for (Eigen::Index j = 0; j < n; j++)
                    for (Eigen::Index c = 10 * j; c < 10 * n; c++)
                        W[static_cast<std::size_t>((c * n + j) * N + t)] = D(j, c);
        }
    }
};

double cpu_seconds()
{
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

int main(int argc, char **argv)
{
    if (argc != 4)
        return 2;
    Loop loop(argv[1], argv[2]);
    std::string request;
    while (std::cin >> request) {
        if (request == "save") {
            std::ofstream file(argv[3], std::ios::binary);
            file.write(reinterpret_cast<const char *>(loop.W.data()), static_cast<std::streamsize>(sizeof(double) * loop.W.size()));
            file.close();
            std::cout << (file ? "saved" : "failed") << std::endl;
            continue;
        }
        int repeats = 0;
        std::cin >> repeats;
        const double start = cpu_seconds();
        for (int k = 0; k < repeats; k++)
            loop.run(request == "keep");
        std::cout << (cpu_seconds() - start) / repeats << std::endl;
    }
    return 0;
}
