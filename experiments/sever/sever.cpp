// Problem:   a cube cut through by a tilted sheet. First its lower part is held still and its upper part moved as a
// rigid
//            body by the surface furthest from the cut; then nothing holds the upper part.
// Reference: no coupling; one part follows the rigid motion, the other stays; six free motions of the part not held.
// Command:   spherecut experiment run sever --out DIR
#include "experiments/analytic/cracks.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"

#include "solvers/collocation/collocation.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

extern "C" void dgesdd_(const char* job, const int* m, const int* n, double* a, const int* lda, double* s, double* u,
                        const int* ldu, double* vt, const int* ldvt, double* work, const int* lwork, int* iwork,
                        int* info);

namespace spherecut::experiments {

namespace {

const CutFrame cut_plane = tilted_frame({0.03, -0.02, 0.06}, {0.21, -0.16, 0.1});

bool is_above(const Vector3& x) {
  return cut_plane.local(x)[1] > 0;
}

Vector3 rigid_motion(const Vector3& x) {
  return Vector3(0.1, -0.2, 0.3) + Vector3(0.4, 0.1, -0.5).cross(x);
}

/// The matrix of a discretisation, entry by entry, in the order of its nodes.
template <class Visit>
void visit_matrix(const solvers::Discretisation& body, const Visit& visit) {
  if (body.method() == solvers::Method::collocation) {
    const solvers::CellBalance balance = solvers::cell_balance_of(body);
    for (int column = 0; column < balance.rows.outerSize(); ++column)
      for (solvers::SparseMatrix::InnerIterator entry(balance.rows, column); entry; ++entry)
        visit(static_cast<int>(entry.row()), column, entry.value());
    return;
  }
  const solvers::OrderedStiffness stiffness = solvers::stiffness_of(body);
  const auto unknown = [&](Eigen::Index k) { return 3 * stiffness.order[k / 3] + static_cast<int>(k % 3); };
  for (int column = 0; column < stiffness.lower.outerSize(); ++column)
    for (solvers::SparseMatrix::InnerIterator entry(stiffness.lower, column); entry; ++entry) {
      visit(unknown(entry.row()), unknown(column), entry.value());
      if (entry.row() / 3 != column / 3) // blocks on the diagonal are full
        visit(unknown(column), unknown(entry.row()), entry.value());
    }
}

double largest_coupling(const solvers::Discretisation& body) {
  const std::vector<Vector3>& positions = body.problem().nodes.positions;
  double coupling = 0;
  visit_matrix(body, [&](int row, int column, double value) {
    if (is_above(positions[row / 3]) != is_above(positions[column / 3]))
      coupling = std::max(coupling, std::abs(value));
  });
  return coupling;
}

std::vector<solvers::Anchor> anchors_in(const solvers::Discretisation& body) {
  return body.method() == solvers::Method::collocation ? solvers::cell_balance_of(body).anchors
                                                       : solvers::stiffness_of(body).anchors;
}

/// Of a square matrix, descending.
VectorX singular_values(MatrixX matrix) {
  const int n = static_cast<int>(matrix.rows()), size = 64 * n + 7 * n;
  VectorX values(n), work(size);
  std::vector<int> whole(static_cast<std::size_t>(8) * n);
  const int one = 1;
  int info = 0;
  dgesdd_("N", &n, &n, matrix.data(), &n, values.data(), nullptr, &one, nullptr, &one, work.data(), &size, whole.data(),
          &info);
  if (info != 0)
    throw NumericalError(fmt::format("the singular values of {} rows were not found (LAPACK dgesdd {})", n, info));
  return values;
}

/// Singular values of the matrix of a free piece below 1e-11 of the largest; the springs that hold it are taken off.
int free_motions(const solvers::Discretisation& body, const solvers::Piece& piece) {
  const solvers::Problem& problem = body.problem();
  std::vector<int> place(problem.nodes.size(), -1);
  for (std::size_t k = 0; k < piece.nodes.size(); ++k)
    place[piece.nodes[k]] = static_cast<int>(k);
  MatrixX matrix = MatrixX::Zero(3 * std::ssize(piece.nodes), 3 * std::ssize(piece.nodes));
  visit_matrix(body, [&](int row, int column, double value) {
    const int i = place[row / 3], j = place[column / 3];
    if (i >= 0 && j >= 0)
      matrix(3 * i + row % 3, 3 * j + column % 3) = value;
  });
  for (const solvers::Anchor& anchor : anchors_in(body))
    matrix.block<3, 3>(3 * place[anchor.node], 3 * place[anchor.node]) -=
        problem.material.young_modulus * problem.nodes.spacings[anchor.node] * anchor.direction *
        anchor.direction.transpose();
  const VectorX values = singular_values(std::move(matrix));
  int count = 0;
  for (double value : values)
    count += value < 1e-11 * values[0] ? 1 : 0;
  return count;
}

struct Severed {
  int nodes = 0, pieces = 0, free_motions = 0;
  double coupling = 0, rigid_error = 0, still_error = 0;
};

Severed sever_cube(std::uint64_t seed, solvers::Method method) {
  CutBodyCase cut;
  cut.domain = topology::make_box_domain({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 0.2);
  cut.sheets = {topology::make_rectangle_sheet(cut_plane.origin, cut_plane.normal, cut_plane.ahead, 2, 2, 0.25)};
  cut.coarse = 1;
  cut.nodes = 350;
  cut.seed = seed;
  cut.method = method;
  CutBody body = cut_body(cut);
  body.problem.material = {1, 0.3, 0};
  solvers::Problem moved = body.problem, loose = body.problem;
  hold_surface(
      moved, [](const Vector3& x, const Vector3& n) { return std::abs(n.z()) > 0.5 && std::abs(x.z()) > 0.49; },
      [](const Vector3& x) { return is_above(x) ? rigid_motion(x) : Vector3(Vector3::Zero()); });
  hold_surface(
      loose, [](const Vector3& x, const Vector3& n) { return x.z() < 0 && n.z() < -0.5; },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });

  Severed severed;
  severed.nodes = moved.nodes.size();
  solvers::DiscretisationOptions options;
  options.method = method;
  const auto discretisation = solvers::discretise(moved, options);
  const VectorX u = discretisation->nodal_displacements(discretisation->solve());
  for (int i = 0; i < moved.nodes.size(); ++i) {
    const Vector3& x = moved.nodes.positions[i];
    if (is_above(x))
      severed.rigid_error = std::max(severed.rigid_error, (u.segment<3>(3 * i) - rigid_motion(x)).norm());
    else
      severed.still_error = std::max(severed.still_error, u.segment<3>(3 * i).norm());
  }
  options.unheld = solvers::UnheldPieces::hold;
  const auto held = solvers::discretise(loose, options);
  severed.pieces = static_cast<int>(held->report().pieces.size());
  for (const solvers::Piece& piece : held->report().pieces)
    if (!piece.held)
      severed.free_motions += free_motions(*held, piece);
  severed.coupling = std::max(largest_coupling(*discretisation), largest_coupling(*held));
  return severed;
}

} // namespace

std::vector<Check> run_sever(const ExperimentContext& context) {
  const int seeds = context.quick ? 2 : 10;
  app::Table table(
      {"method", "seed", "nodes", "pieces", "largest_coupling", "rigid_error", "still_error", "free_motions"});
  app::Figure figure{"Severed cube: distance from the rigid motion", "seed", "largest error / m", false, true, {}};
  std::vector<Check> checks;
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    const std::string name(solvers::to_string(method));
    app::Series rigid{name, {}, {}, app::SeriesStyle::points};
    Severed worst;
    int fewest = 1000, most = 0, wrong_pieces = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const Severed severed = sever_cube(static_cast<std::uint64_t>(seed), method);
      wrong_pieces += severed.pieces == 2 ? 0 : 1;
      worst.coupling = std::max(worst.coupling, severed.coupling);
      worst.rigid_error = std::max(worst.rigid_error, severed.rigid_error);
      worst.still_error = std::max(worst.still_error, severed.still_error);
      fewest = std::min(fewest, severed.free_motions);
      most = std::max(most, severed.free_motions);
      rigid.x.push_back(seed);
      rigid.y.push_back(severed.rigid_error);
      table.add({name, fmt::format("{}", seed), fmt::format("{}", severed.nodes), fmt::format("{}", severed.pieces),
                 fmt::format("{}", severed.coupling), fmt::format("{:.3e}", severed.rigid_error),
                 fmt::format("{:.3e}", severed.still_error), fmt::format("{}", severed.free_motions)});
    }
    context.say(fmt::format("{}: coupling {}, rigid {:.1e}, still {:.1e}, free motions {} to {}", name, worst.coupling,
                            worst.rigid_error, worst.still_error, fewest, most));
    figure.series.push_back(rigid);
    checks.push_back({"sever_" + name + "_coupling", worst.coupling, "<=", 0});
    checks.push_back({"sever_" + name + "_rigid_error", worst.rigid_error, "<=", 1e-12});
    checks.push_back({"sever_" + name + "_still_error", worst.still_error, "<=", 0});
    checks.push_back({"sever_" + name + "_fewest_free_motions", static_cast<double>(fewest), ">=", 6});
    checks.push_back({"sever_" + name + "_most_free_motions", static_cast<double>(most), "<=", 6});
    checks.push_back({"sever_" + name + "_wrong_piece_counts", static_cast<double>(wrong_pieces), "<=", 0});
  }
  table.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "rigid.png");
  return checks;
}

} // namespace spherecut::experiments
