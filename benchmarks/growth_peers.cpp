// The peer of growth_peers.py: C code of pinocchio's computeJointTorqueRegressor, written by CasADi.
//
//     growth_peers MODEL FOLDER
//
// MODEL, text: number of joints; gravity; then per joint its parent, 1 if it slides, rotation by rows and origin of its frame at q = 0 in
// the frame of the parent. Writes FOLDER/peer.c with the function D(q, qd, qdd), whose zeros are structural.

#include <pinocchio/autodiff/casadi.hpp>

#include <fstream>
#include <string>

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
        pinocchio::JointIndex parent = 0;
        Eigen::Matrix3d R;
        Eigen::Vector3d p;
        file >> parent >> slides;
        for (int k = 0; k < 9; k++)
            file >> R(k / 3, k % 3);
        file >> p.x() >> p.y() >> p.z();
        const std::string name = "joint" + std::to_string(j);
        if (slides)
            model.addJoint(parent, pinocchio::JointModelPZ(), pinocchio::SE3(R, p), name);
        else
            model.addJoint(parent, pinocchio::JointModelRZ(), pinocchio::SE3(R, p), name);
    }
    return model;
}

}  // namespace

int main(int, char **argv)
{
    using Scalar = casadi::SX;
    using Model = pinocchio::ModelTpl<Scalar>;
    const Model model = read_model(argv[1]).cast<Scalar>();
    pinocchio::DataTpl<Scalar> data(model);
    const casadi_int n = model.nv;
    std::vector<Scalar> inputs;
    std::vector<Eigen::Matrix<Scalar, Eigen::Dynamic, 1>> states;
    for (const char *name : {"q", "qd", "qdd"}) {
        inputs.push_back(Scalar::sym(name, n));
        Eigen::Matrix<Scalar, Eigen::Dynamic, 1> state(n);
        for (casadi_int k = 0; k < n; k++)
            state(k) = inputs.back()(k);
        states.push_back(state);
    }
    pinocchio::computeJointTorqueRegressor(model, data, states[0], states[1], states[2]);
    const auto &D = data.jointTorqueRegressor;
    std::vector<casadi_int> rows, columns;
    std::vector<Scalar> entries;
    for (casadi_int c = 0; c < D.cols(); c++)
        for (casadi_int r = 0; r < D.rows(); r++)
            if (!D(r, c).is_zero()) {
                rows.push_back(r);
                columns.push_back(c);
                entries.push_back(D(r, c));
            }
    const Scalar sparse = Scalar::triplet(rows, columns, vertcat(entries), D.rows(), D.cols());
    casadi::Function function("D", inputs, {sparse});
    casadi::CodeGenerator generator("peer.c");
    generator.add(function);
    generator.generate(std::string(argv[2]) + "/");
}
