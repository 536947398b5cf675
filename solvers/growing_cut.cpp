#include "solvers/growing_cut.hpp"

#include "solvers/cell_shapes.hpp"
#include "solvers/elastic_body.hpp"
#include "solvers/galerkin.hpp"
#include "solvers/schur_window.hpp"
#include "solvers/stiffness_kernel.hpp"
#include "topology/errors.hpp"
#include "topology/point_tree.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace spherecut::solvers {

namespace {

/// Rings of new nodes stand this far from the sheet or its front, and crowded nodes within it are removed; in units of
/// the sphere radius. What their spheres covered or will cover changes too.
constexpr double node_margin = 0.35;

/// Nodes are exchanged so far from new faces, in spacings (extend_sprinkling), and are nearest to places a little
/// farther away.
constexpr double exchange_reach = 3;

/// Shares of the surface about some nodes are found from the surface this far around them, in spacings.
constexpr double shares_reach = 4;
/// A share itself changes when faces or surface nodes come this near to it, in spacings.
constexpr double share_size = 2;

/// Of a sphere radius: eyes at a bulging face are lifted off it before they look (cut_sight.cpp), by 0.05 at both ends.
constexpr double looking_around = 1.1;

/// Points of a sheet no farther than `spacing` apart, m: corners and midpoints of its triangles, divided as needed.
std::vector<Vector3> sample_points(const topology::SurfaceMesh& sheet, std::size_t first_triangle, double spacing) {
  std::vector<Vector3> points;
  std::vector<std::array<Vector3, 3>> pending;
  for (std::size_t t = first_triangle; t < sheet.triangles.size(); ++t) {
    const Triangle& triangle = sheet.triangles[t];
    pending.push_back({sheet.vertices[triangle[0]], sheet.vertices[triangle[1]], sheet.vertices[triangle[2]]});
    while (!pending.empty()) {
      const std::array<Vector3, 3> corner = pending.back();
      pending.pop_back();
      const double longest =
          std::max({(corner[1] - corner[0]).norm(), (corner[2] - corner[1]).norm(), (corner[0] - corner[2]).norm()});
      if (longest <= spacing) {
        points.insert(points.end(), corner.begin(), corner.end());
        continue;
      }
      const std::array<Vector3, 3> middle = {0.5 * (corner[0] + corner[1]), 0.5 * (corner[1] + corner[2]),
                                             0.5 * (corner[2] + corner[0])};
      pending.push_back({corner[0], middle[0], middle[2]});
      pending.push_back({middle[0], corner[1], middle[1]});
      pending.push_back({middle[2], middle[1], corner[2]});
      pending.push_back(middle);
    }
  }
  return points;
}

/// Whether the sheets of `now` continue those of `before` triangle by triangle.
bool continues(const topology::Incision* before, const topology::Incision& now) {
  if (before == nullptr)
    return true;
  if (now.sheets().size() < before->sheets().size())
    return false;
  for (std::size_t s = 0; s < before->sheets().size(); ++s) {
    const topology::SurfaceMesh &a = before->sheets()[s], &b = now.sheets()[s];
    if (b.triangles.size() < a.triangles.size() || b.vertices.size() < a.vertices.size() ||
        !std::equal(a.triangles.begin(), a.triangles.end(), b.triangles.begin()) ||
        !std::equal(a.vertices.begin(), a.vertices.end(), b.vertices.begin()))
      return false;
  }
  return true;
}

NodeCloud present_nodes(const NodeCloud& nodes, const std::vector<char>& removed) {
  NodeCloud present;
  for (int i = 0; i < nodes.size(); ++i)
    if (removed[i] == 0)
      present.add(nodes.positions[i], nodes.spacings[i], nodes.kinds[i], nodes.normals[i]);
  return present;
}

/// Spacing of the present node nearest to a place.
class SpacingAt {
 public:
  SpacingAt(const NodeCloud& nodes, const std::vector<char>& removed) : SpacingAt(present_nodes(nodes, removed)) {}
  [[nodiscard]] double operator()(const Vector3& x) const {
    return spacings_[static_cast<std::size_t>(tree_.nearest(x).index)];
  }

 private:
  explicit SpacingAt(const NodeCloud& present) : spacings_(present.spacings), tree_(present.positions) {}
  std::vector<double> spacings_;
  topology::PointTree tree_;
};

/// Where the cut differs: the new faces, and the front that was or has come.
struct Changes {
  std::vector<Vector3> faces, front;
};

Changes changes_between(const topology::Incision* before, const SpacingAt& spacing_before,
                        const topology::Incision& now, const SpacingAt& spacing_now, double spacing) {
  Changes changes;
  for (std::size_t s = 0; s < now.sheets().size(); ++s) {
    const std::size_t known =
        before != nullptr && s < before->sheets().size() ? before->sheets()[s].triangles.size() : 0;
    const std::vector<Vector3> points = sample_points(now.sheets()[s], known, spacing);
    changes.faces.insert(changes.faces.end(), points.begin(), points.end());
  }
  // The reach of the enrichment goes with the spacing of the node nearest to a segment, so that counts too.
  using Ends = std::array<double, 7>;
  const auto ends = [](const topology::FrontSegment& f, const SpacingAt& spacing_at) {
    return Ends{f.from.x(), f.from.y(), f.from.z(), f.to.x(), f.to.y(), f.to.z(), spacing_at(0.5 * (f.from + f.to))};
  };
  std::vector<Ends> old_front, new_front;
  if (before != nullptr)
    for (const topology::FrontSegment& segment : before->front())
      old_front.push_back(ends(segment, spacing_before));
  for (const topology::FrontSegment& segment : now.front())
    new_front.push_back(ends(segment, spacing_now));
  std::sort(old_front.begin(), old_front.end());
  std::sort(new_front.begin(), new_front.end());
  std::vector<Ends> different;
  std::set_symmetric_difference(old_front.begin(), old_front.end(), new_front.begin(), new_front.end(),
                                std::back_inserter(different));
  for (const Ends& e : different) {
    const Vector3 from(e[0], e[1], e[2]), to(e[3], e[4], e[5]);
    const int parts = std::max(1, static_cast<int>(std::ceil((to - from).norm() / spacing)));
    for (int k = 0; k <= parts; ++k)
      changes.front.push_back(from + (to - from) * k / parts);
  }
  return changes;
}

/// Places on the front of an incision (null: none) no farther than `spacing` apart.
void add_front(const topology::Incision* incision, double spacing, std::vector<Vector3>& places) {
  if (incision == nullptr)
    return;
  for (const topology::FrontSegment& segment : incision->front()) {
    const int parts = std::max(1, static_cast<int>(std::ceil((segment.to - segment.from).norm() / spacing)));
    for (int k = 0; k <= parts; ++k)
      places.push_back(segment.from + (segment.to - segment.from) * k / parts);
  }
}

/// Distance to the nearest of some points, infinite when there are none.
class Nearness {
 public:
  explicit Nearness(const std::vector<Vector3>& points) : points_(points) {
    if (!points.empty())
      tree_.emplace(points);
  }
  [[nodiscard]] std::optional<Vector3> place(const Vector3& x) const {
    return tree_ ? std::optional(points_[static_cast<std::size_t>(tree_->nearest(x).index)]) : std::nullopt;
  }
  [[nodiscard]] double operator()(const Vector3& x) const {
    return tree_ ? std::sqrt(tree_->nearest(x).squared_distance) : std::numeric_limits<double>::infinity();
  }

 private:
  std::vector<Vector3> points_;
  std::optional<topology::PointTree> tree_;
};

/// Which places a change of the cut can reach: a point x sees a node y of sphere radius R another way only where some
/// changed place p of faces or front lies on the way, |x - p| + |p - y| < R. Coarse nodes far from the change have
/// large spheres that it does not concern.
class Reach {
 public:
  /// `radii` of the spheres about `nodes`, 0: absent. `slack` m: how far places between the given ones may be off.
  /// `all_front`: all there is of the front, changed or not; `enriched`: reach of its enrichment in sphere radii.
  Reach(const std::vector<Vector3>& faces, const std::vector<Vector3>& front, const std::vector<Vector3>& all_front,
        double enriched, const std::vector<Vector3>& nodes, const std::vector<double>& radii, double slack)
      : to_faces_(faces), to_front_(front), to_all_(all_front), enriched_(enriched), slack_(slack) {
    std::vector<Vector3> present;
    for (std::size_t j = 0; j < nodes.size(); ++j) {
      if (!(radii[j] > 0))
        continue;
      present.push_back(nodes[j]);
      present_radii_.push_back(radii[j]);
      if (const double spare = looking_around * radii[j] - to_faces_(nodes[j]) + slack; spare > 0)
        by_faces_.push_back({nodes[j], radii[j], spare});
      if (const double spare = looking_around * radii[j] - to_front_(nodes[j]) + slack; spare > 0)
        by_front_.push_back({nodes[j], radii[j], spare});
      // The branch functions at a node are those of the front nearest to it.
      if (const double distance = to_front_(nodes[j]);
          enriched > 0 && distance < (2 * enriched + 1) * radii[j] && distance < to_all_(nodes[j]) + 2 * slack)
        by_branch_.push_back({nodes[j], radii[j], 0});
    }
    present_.emplace(present);
  }

  /// Whether something within `half` m of x sees or is hidden differently, or is enriched by other functions.
  [[nodiscard]] bool sees(const Vector3& x, double half) const {
    const double faces = to_faces_(x) - half - slack_, front = to_front_(x) - half - slack_;
    const auto holds = [&](const Eye& eye) {
      return (eye.position - x).squaredNorm() < (eye.radius + half) * (eye.radius + half);
    };
    const auto concerns = [&](const std::vector<Eye>& eyes, double distance) {
      return std::any_of(eyes.begin(), eyes.end(), [&](const Eye& eye) { return distance < eye.spare && holds(eye); });
    };
    return faces < 0 || concerns(by_faces_, faces) || concerns(by_front_, front) ||
           (!by_branch_.empty() && to_all_(x) - half - slack_ < enriched_ * radius_beside(to_all_, x) &&
            std::any_of(by_branch_.begin(), by_branch_.end(), holds));
  }
  /// Whether a place within `half` m of x is nearer to the front, or to the faces, than `radii` sphere radii there.
  [[nodiscard]] bool near_front(const Vector3& x, double half, double radii) const {
    return to_front_(x) - half - slack_ < radii * radius_beside(to_front_, x);
  }
  [[nodiscard]] bool near_faces(const Vector3& x, double half, double radii) const {
    return to_faces_(x) - half - slack_ < radii * radius_beside(to_faces_, x);
  }

 private:
  struct Eye {
    Vector3 position;
    double radius, spare;
  };
  /// Radius of the sphere about the node nearest to the change's place nearest to x.
  [[nodiscard]] double radius_beside(const Nearness& change, const Vector3& x) const {
    const std::optional<Vector3> place = change.place(x);
    return place ? present_radii_[static_cast<std::size_t>(present_->nearest(*place).index)] : 0;
  }

  Nearness to_faces_, to_front_, to_all_;
  double enriched_;
  std::optional<topology::PointTree> present_;
  std::vector<double> present_radii_;
  std::vector<Eye> by_faces_, by_front_, by_branch_;
  double slack_;
};

/// The surface shared out among the present nodes, as the ordinary discretisation does it.
struct Shares {
  NodeCloud nodes;
  std::vector<int> compact; // place of each node of the problem in `nodes`
  SurfacePatches patches;

  Shares(const Problem& problem, const std::vector<char>& removed,
         const std::optional<BoundingBox>& region = std::nullopt)
      : nodes(present_nodes(problem.nodes, removed)), patches(*problem.domain, nodes, problem.incision, region) {
    int place = 0;
    for (const char gone : removed)
      compact.push_back(gone != 0 ? -1 : place++);
  }
};

/// What each prescribed entry holds, as the ordinary discretisation takes it.
std::vector<DisplacementMean> held_means(const Problem& problem, const Spheres& spheres, const Shares& shares) {
  if (problem.prescribed_region) {
    std::vector<int> nodes;
    nodes.reserve(problem.prescribed.size());
    for (const Prescribed& entry : problem.prescribed)
      nodes.push_back(shares.compact[entry.node]);
    return shares.patches.means(nodes, spheres, problem.prescribed_region);
  }
  std::vector<DisplacementMean> means;
  means.reserve(problem.prescribed.size());
  for (const Prescribed& entry : problem.prescribed)
    means.push_back(value_at(spheres, problem.nodes.positions[entry.node]));
  return means;
}

/// Whether two means differ by no more than the order of summation.
bool equal_to_rounding(const DisplacementMean& a, const DisplacementMean& b) {
  return a.nodes == b.nodes && std::equal(a.weights.begin(), a.weights.end(), b.weights.begin(),
                                          [](double v, double w) { return std::abs(v - w) <= 1e-14; });
}

/// A held mean that the two do not have in common: from one it has to go, to the other it has to come.
struct HeldChange {
  int before = -1, now = -1; // entries, -1: none
};

std::vector<HeldChange> held_changes(const std::vector<Prescribed>& before, const std::vector<DisplacementMean>& old,
                                     const std::vector<Prescribed>& now, const std::vector<DisplacementMean>& held) {
  std::unordered_map<int, int> entry;
  for (int k = 0; k < std::ssize(before); ++k)
    entry.emplace(before[k].node, k);
  std::vector<HeldChange> changes;
  for (int k = 0; k < std::ssize(now); ++k) {
    const auto known = entry.find(now[k].node);
    if (known == entry.end()) {
      changes.push_back({-1, k});
      continue;
    }
    const int b = known->second;
    entry.erase(known);
    if (!equal_to_rounding(held[k], old[b]) || now[k].components != before[b].components)
      changes.push_back({b, k});
  }
  for (int k = 0; k < std::ssize(before); ++k)
    if (entry.contains(before[k].node))
      changes.push_back({k, -1});
  return changes;
}

} // namespace

double window_share(const Problem& problem, const DiscretisationOptions& method, const topology::SurfaceMesh& way) {
  const std::vector<double>& spacings = problem.nodes.spacings;
  const double rho = galerkin_support_radius(problem, method);
  const double finest = *std::min_element(spacings.begin(), spacings.end());
  const Nearness to_way(sample_points(way, 0, finest));
  // Cells that a change within a sphere of it can reach, and the nodes whose spheres reach those.
  const double reach = (1 + node_margin) * rho * finest + method.cell_size * finest;
  int inside = 0;
  for (std::size_t i = 0; i < spacings.size(); ++i)
    inside += to_way(problem.nodes.positions[i]) < reach + rho * spacings[i] ? 1 : 0;
  return static_cast<double>(inside) / static_cast<double>(spacings.size());
}

struct GrowingCut::State {
  struct Box {
    BackgroundBox box;
    std::vector<CellShapes> cells;                    // by node ids
    std::vector<std::vector<QuadraturePoint>> points; // of each cell, kept where loads need them
    bool exchanged = false;                           // since the condensation
    std::vector<CellShapes> first{};                  // then: as they were at it
  };

  Problem problem;
  GrowthOptions options;
  double rho = 2;
  std::vector<char> removed;
  std::unique_ptr<Spheres> spheres;
  std::vector<Box> boxes;
  std::vector<DisplacementMean> held;
  std::unique_ptr<SchurWindow> window;
  std::vector<int> far_order;   // node of every far rank
  std::vector<int> slot;        // block of three slots of every node in the window, -1 outside
  std::vector<int> window_node; // node of every block of slots, -1 for room
  int next_room = 0;
  VectorX cell_loads;                     // 3N: body force and initial strain
  VectorX first_loads;                    // 3N at condensation, all loads
  VectorX external;                       // 3N as they stand, without those of prescribed displacements
  VectorX loads;                          // 3N as they stand
  MatrixX reduced_first;                  // by slots
  mutable std::unique_ptr<Shares> shares; // null: not needed so far
  AssemblyReport report;                  // of the condensation
  std::vector<Anchor> anchors;            // by ids
  SparseMatrix elastic;                   // stiffness at condensation without held means, in its elimination order
  std::vector<int> elastic_order;         // node of every rank there
  std::vector<DisplacementMean> contact;
  MatrixX compliance;
  VectorX base;

  State(Problem p, GrowthOptions o) : problem(std::move(p)), options(std::move(o)) {
    if (options.method.method != Method::galerkin)
      throw InputError(
          fmt::format("a growing cut is updated in method galerkin, not {}", to_string(options.method.method)));
    for (int node : options.contact)
      if (node < 0 || node >= problem.nodes.size())
        throw InputError(
            fmt::format("contact candidate {} does not exist; there are {} nodes", node, problem.nodes.size()));
    if (options.way.triangles.empty())
      throw InputError("the predicted way of the cut is empty");
    rho = galerkin_support_radius(problem, options.method);
    removed.assign(problem.nodes.size(), 0);
  }

  [[nodiscard]] BackgroundOptions background() const { return {options.method.cell_size, options.method.quadrature}; }
  [[nodiscard]] std::unique_ptr<Spheres> make_spheres() const {
    return std::make_unique<Spheres>(problem.nodes.positions, problem.nodes.spacings, rho, Basis::linear,
                                     worst_moment_condition, sight_about_cut(problem, options.method.sight), removed);
  }
  [[nodiscard]] double enrichment_reach() const {
    return options.method.sight == SightRule::enriched ? sight_about_cut(problem, options.method.sight).reach / rho
                                                       : 0; // in sphere radii
  }
  /// Largest sphere about a point, m.
  [[nodiscard]] double radius_at(const Vector3& x) const {
    double radius = 0;
    for (int node : spheres->candidates(x))
      radius = std::max(radius, spheres->radii()[node]);
    return radius;
  }
  [[nodiscard]] bool has_cell_loads() const {
    return problem.loads.body_force != nullptr || !problem.loads.initial_strain.isZero(0);
  }

  void evaluate(Box& box, const BackgroundCells& filled, CellEvaluator& evaluator) const {
    box.cells.resize(filled.start.size() - 1);
    box.points.resize(has_cell_loads() ? box.cells.size() : 0);
    for (std::size_t c = 0; c < box.cells.size(); ++c) {
      evaluator.evaluate(filled.of(static_cast<int>(c)), box.cells[c]);
      if (has_cell_loads())
        box.points[c].assign(filled.of(static_cast<int>(c)).begin(), filled.of(static_cast<int>(c)).end());
    }
  }

  /// Adds sign times the stiffness of a cell, whose nodes are all in the window, to S.
  void scatter(const CellShapes& by_node, double sign, CellEvaluator& evaluator, CellShapes& by_slot) {
    by_slot = by_node;
    evaluator.renumber(slot, by_slot);
    const double mu = problem.material.shear_modulus(), lambda = problem.material.lame_lambda();
    const int size = static_cast<int>(by_slot.nodes.size());
    StiffnessColumn column;
    for (int own = 0; own < size; ++own) {
      stiffness_column(by_slot.gradients.data(), by_slot.points, by_slot.stride, own, size, own, lambda, mu, column);
      const int first = 3 * by_slot.nodes[own];
      for (int b = 0; b < 3; ++b) {
        double* target = window->column(first + b);
        for (int k = own; k < size; ++k)
          for (int a = 0; a < 3; ++a)
            target[3 * by_slot.nodes[k] + a] += sign * column.plane[3 * a + b][k];
      }
    }
  }

  /// The same of a held mean of problem `of`.
  void scatter(const DisplacementMean& mean, const Problem& of, const Prescribed& entry, double sign) {
    const double factor = sign * constraint_stiffness(of, entry.node);
    for (std::size_t i = 0; i < mean.nodes.size(); ++i)
      for (std::size_t j = 0; j < mean.nodes.size(); ++j)
        if (slot[mean.nodes[i]] >= slot[mean.nodes[j]])
          for (int c = 0; c < 3; ++c)
            if (entry.components[c])
              window->column(3 * slot[mean.nodes[j]] + c)[3 * slot[mean.nodes[i]] + c] +=
                  factor * mean.weights[i] * mean.weights[j];
  }

  /// Body force and initial strain of a box, times `sign`.
  void add_cell_loads(const Box& box, double sign, const Spheres& of, VectorX& into) const {
    if (!has_cell_loads())
      return;
    const Matrix3 initial = initial_stress(problem);
    ShapeFunctions shape;
    for (std::size_t c = 0; c < box.cells.size(); ++c)
      for (int q = 0; q < box.cells[c].points; ++q) {
        const QuadraturePoint& point = box.points[c][q];
        if (problem.loads.body_force && solvers::evaluate(of, point.position, shape)) {
          const Vector3 force = sign * point.weight * problem.loads.body_force(point.position);
          for (int k = 0; k < shape.size(); ++k)
            into.segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) += shape.value[k] * force;
        }
        const CellShapes& cell = box.cells[c];
        const double* x = cell.gradients.data() + static_cast<std::ptrdiff_t>(3 * q) * cell.stride;
        const double root = sign * std::sqrt(point.weight);
        for (std::size_t k = 0; k < cell.nodes.size(); ++k)
          into.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) +=
              root * initial * Vector3(x[k], x[cell.stride + k], x[2 * cell.stride + k]);
      }
  }

  /// All loads as they stand.
  void find_loads() {
    external = cell_loads + tractions();
    loads = external;
    for (std::size_t k = 0; k < held.size(); ++k) {
      const Prescribed& entry = problem.prescribed[k];
      const Vector3 value = problem.prescribed_field ? problem.prescribed_field(held[k].centroid) : entry.value;
      const Vector3 force = constraint_stiffness(problem, entry.node) * held_part(entry, value);
      for (std::size_t j = 0; j < held[k].nodes.size(); ++j)
        loads.segment<3>(3 * static_cast<Eigen::Index>(held[k].nodes[j])) += held[k].weights[j] * force;
    }
  }

  /// Of tractions on the surface and the lips.
  [[nodiscard]] VectorX tractions() const {
    VectorX right = VectorX::Zero(3 * static_cast<Eigen::Index>(problem.nodes.size()));
    ShapeFunctions shape;
    const auto add = [&](const SurfacePoint& point, const Vector3& traction) {
      if (traction.isZero(0))
        return;
      if (!solvers::evaluate(*spheres, point.position, shape))
        throw NumericalError(fmt::format("no sound support covers the loaded point ({:.6g}, {:.6g}, {:.6g}) m",
                                         point.position.x(), point.position.y(), point.position.z()));
      for (int k = 0; k < shape.size(); ++k)
        right.segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) += point.weight * shape.value[k] * traction;
    };
    if (!problem.loads.traction && !problem.loads.lip_traction)
      return right;
    const NodeCloud present = present_nodes(problem.nodes, removed);
    if (problem.loads.traction)
      for (const SurfacePoint& point : surface_quadrature(*problem.domain, present, 0.5, 0, problem.incision.get()))
        add(point, problem.loads.traction(point.position, point.normal));
    if (problem.loads.lip_traction && problem.incision != nullptr)
      for (const SurfacePoint& point : lip_quadrature(*problem.incision, present))
        add(point, problem.loads.lip_traction(point.position, point.normal));
    return right;
  }

  [[nodiscard]] DisplacementMean mean(int node) const {
    if (removed[node] != 0)
      throw InputError(fmt::format("node {} has been removed by the cut", node));
    if (shares == nullptr)
      shares = std::make_unique<Shares>(problem, removed);
    return shares->patches.mean(shares->compact[node], *spheres, problem.prescribed_region);
  }

  /// Candidates that the cut has removed are none any more.
  void find_contact() {
    std::erase_if(options.contact, [&](int node) { return removed[node] != 0; });
    contact.clear();
    if (options.contact.empty())
      return;
    BoundingBox region{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
    for (int node : options.contact) {
      const double room = shares_reach * problem.nodes.spacings[node];
      region.lower = region.lower.cwiseMin((problem.nodes.positions[node].array() - room).matrix());
      region.upper = region.upper.cwiseMax((problem.nodes.positions[node].array() + room).matrix());
    }
    const Shares regional(problem, removed, region);
    for (int node : options.contact)
      contact.push_back(regional.patches.mean(regional.compact[node], *spheres, problem.prescribed_region));
  }

  /// Whether an increment along `way` may change what lies within `half` of x, m; also where the nodes that it
  /// exchanges are of another spacing.
  [[nodiscard]] auto reach_of(const topology::SurfaceMesh& way, bool nodes_may_coarsen) const {
    const double slack = 0.5 * *std::min_element(problem.nodes.spacings.begin(), problem.nodes.spacings.end());
    const std::vector<Vector3> places = sample_points(way, 0, slack);
    // The front of today near it: nodes that are exchanged there change the reach of its enrichment.
    std::vector<Vector3> front = places;
    if (problem.incision != nullptr && nodes_may_coarsen) {
      const Nearness to_way(places);
      const SpacingAt spacing_at(problem.nodes, removed);
      for (const topology::FrontSegment& segment : problem.incision->front())
        if (const Vector3 middle = 0.5 * (segment.from + segment.to);
            to_way(middle) < exchange_reach * spacing_at(middle))
          for (const Vector3& x : {segment.from, middle, segment.to})
            front.push_back(x);
    }
    std::vector<Vector3> all_front = front;
    add_front(problem.incision.get(), slack, all_front);
    return [reach = std::make_shared<Reach>(places, front, all_front, enrichment_reach(), problem.nodes.positions,
                                            spheres->radii(), slack),
            margin = 1 + node_margin, enriched = std::max(1.0, enrichment_reach())](const Vector3& x, double half) {
      return reach->sees(x, half) || reach->near_faces(x, half, margin) || reach->near_front(x, half, enriched);
    };
  }

  void condense_all();
  void condense_contact();
  [[nodiscard]] VectorX window_right(const VectorX& right) const;
  [[nodiscard]] MatrixX respond(const MatrixX& forces) const;
  [[nodiscard]] VectorX elastic_forces(const VectorX& coefficients) const;
};

/// Builds everything from the problem as it stands. Removed nodes leave the arrays first: nothing refers to them yet
/// but the ids of the caller, so they stay where they are and merely have no sphere.
void GrowingCut::State::condense_all() {
  // The system of the present nodes, compact, from the ordinary discretisation; ids are mapped back afterwards.
  std::vector<int> id, compact(problem.nodes.size(), -1);
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (removed[i] == 0) {
      compact[i] = static_cast<int>(id.size());
      id.push_back(i);
    }
  Problem present = problem;
  present.nodes = present_nodes(problem.nodes, removed);
  for (Prescribed& entry : present.prescribed)
    entry.node = compact[entry.node];
  // The ordinary factor is good for the condition estimate alone.
  const std::unique_ptr<Discretisation> body = options.method.estimate_condition
                                                   ? discretise(std::move(present), options.method)
                                                   : assemble_galerkin(std::move(present), options.method);
  const OrderedStiffness stiffness = stiffness_of(*body);
  if (stiffness.dropped)
    throw InputError("a severed piece that leaves the computation cannot be followed by an update");
  report = body->report();
  anchors = stiffness.anchors;
  for (Anchor& anchor : anchors)
    anchor.node = id[anchor.node];
  elastic = stiffness.elastic;
  elastic_order.clear();
  for (const int node : stiffness.order)
    elastic_order.push_back(id[node]);

  spheres = make_spheres();
  shares.reset();
  held = stiffness.held;
  for (DisplacementMean& mean : held)
    for (int& node : mean.nodes)
      node = id[node]; // ascending still
  boxes.clear();
  CellEvaluator evaluator(*spheres);
  std::vector<char> in_window(problem.nodes.size(), 0);
  const auto in_reach = reach_of(options.way, true);
  for (const BackgroundBox& leaf : stiffness.cells.boxes) {
    Box box{leaf, {}, {}};
    if (in_reach(leaf.centre, leaf.half.norm()))
      for (int c = leaf.first_cell; c < leaf.last_cell; ++c) {
        box.cells.push_back(stiffness.shapes[static_cast<std::size_t>(c)]);
        evaluator.renumber(elastic_order, box.cells.back());
        if (has_cell_loads())
          box.points.emplace_back(stiffness.cells.of(c).begin(), stiffness.cells.of(c).end());
        for (int node : box.cells.back().nodes)
          in_window[node] = 1;
      }
    boxes.push_back(std::move(box));
  }
  cell_loads = VectorX::Zero(3 * static_cast<Eigen::Index>(problem.nodes.size()));
  for (Eigen::Index i = 0; i < std::ssize(id); ++i)
    cell_loads.segment<3>(3 * static_cast<Eigen::Index>(id[i])) = stiffness.loads.segment<3>(3 * i);
  cell_loads -= tractions();
  find_contact();
  std::vector<char> in_contact(problem.nodes.size(), 0);
  for (const DisplacementMean& mean : contact)
    for (int node : mean.nodes)
      in_contact[node] = 1;

  // Far nodes in the order that the ordinary factorisation found good, then the window, then the contact.
  std::vector<int> order;
  for (int place = 0; place < 3; ++place)
    for (int rank = 0; rank < std::ssize(stiffness.order); ++rank) {
      const int node = id[stiffness.order[rank]];
      const int wanted = in_contact[node] != 0 ? 2 : in_window[node] != 0 ? 1 : 0;
      if (wanted == place)
        order.push_back(rank);
    }
  std::vector<int> new_rank(order.size());
  for (int k = 0; k < std::ssize(order); ++k)
    new_rank[order[k]] = k;
  Eigen::PermutationMatrix<Eigen::Dynamic> permutation(3 * std::ssize(order));
  for (Eigen::Index k = 0; k < std::ssize(order); ++k)
    for (int c = 0; c < 3; ++c)
      permutation.indices()[3 * k + c] = 3 * new_rank[static_cast<std::size_t>(k)] + c;
  SparseMatrix permuted(stiffness.lower.rows(), stiffness.lower.cols());
  permuted.selfadjointView<Eigen::Lower>() = stiffness.lower.selfadjointView<Eigen::Lower>().twistedBy(permutation);

  const auto count = [&](const auto& wanted) {
    int n = 0;
    for (int rank : order)
      n += wanted(id[stiffness.order[rank]]) ? 1 : 0;
    return n;
  };
  const int contact_nodes = count([&](int node) { return in_contact[node] != 0; });
  const int changing = count([&](int node) { return in_contact[node] == 0 && in_window[node] != 0; });
  window = std::make_unique<SchurWindow>(permuted, 3 * changing, 3 * options.room, 3 * contact_nodes);
  slot.assign(problem.nodes.size(), -1);
  window_node.assign(static_cast<std::size_t>(window->slots() / 3), -1);
  far_order.clear();
  for (int k = 0; k < std::ssize(order); ++k) {
    const int node = id[stiffness.order[order[k]]], s = window->slot_of(3 * k);
    if (s < 0) {
      far_order.push_back(node);
    } else {
      slot[node] = s / 3;
      window_node[s / 3] = node;
    }
  }
  next_room = changing;
  find_loads();
  first_loads = loads;
  VectorX ordered(3 * std::ssize(order));
  for (Eigen::Index k = 0; k < std::ssize(order); ++k)
    ordered.segment<3>(3 * k) = first_loads.segment<3>(3 * id[stiffness.order[order[k]]]);
  reduced_first = window->reduce(ordered);
  window->factor();
  condense_contact();
}

/// Right-hand side by slots under `right` (3N), which differs from the first loads in window nodes alone.
VectorX GrowingCut::State::window_right(const VectorX& right) const {
  VectorX by_slot = reduced_first.col(0);
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const int node = window_node[s]; node >= 0) {
      by_slot.segment<3>(3 * s) += right.segment<3>(3 * node);
      if (3 * node < first_loads.size())
        by_slot.segment<3>(3 * s) -= first_loads.segment<3>(3 * node);
    }
  return by_slot;
}

/// Coefficients under forces (3N rows) anywhere. What acts on the window alone need not pass the far part first.
MatrixX GrowingCut::State::respond(const MatrixX& forces) const {
  const Eigen::Index size = window->far() + window->slots() - 3 * static_cast<Eigen::Index>(options.room);
  MatrixX ordered = MatrixX::Zero(size, forces.cols());
  for (Eigen::Index k = 0; k < std::ssize(far_order); ++k)
    ordered.middleRows<3>(3 * k) = forces.middleRows<3>(3 * static_cast<Eigen::Index>(far_order[k]));
  const bool far = !ordered.isZero(0);
  MatrixX right = far ? window->reduce(ordered) : MatrixX::Zero(window->slots(), forces.cols());
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const Eigen::Index node = window_node[s]; node >= 0)
      right.middleRows<3>(3 * s) += forces.middleRows<3>(3 * node);
  const MatrixX in_window = window->solve(right);
  const MatrixX recovered = far ? window->recover(in_window, ordered) : window->recover(in_window);
  MatrixX coefficients = MatrixX::Zero(forces.rows(), forces.cols());
  for (Eigen::Index k = 0; k < std::ssize(far_order); ++k)
    coefficients.middleRows<3>(3 * static_cast<Eigen::Index>(far_order[k])) = recovered.middleRows<3>(3 * k);
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const Eigen::Index node = window_node[s]; node >= 0)
      coefficients.middleRows<3>(3 * node) = in_window.middleRows<3>(3 * s);
  return coefficients;
}

/// The stiffness as the cells make it, not as the window has it: that at condensation, and what the exchanged boxes are
/// now less what they were.
VectorX GrowingCut::State::elastic_forces(const VectorX& coefficients) const {
  VectorX ordered(elastic.rows());
  for (Eigen::Index k = 0; k < std::ssize(elastic_order); ++k)
    ordered.segment<3>(3 * k) = coefficients.segment<3>(3 * static_cast<Eigen::Index>(elastic_order[k]));
  const VectorX product = elastic.selfadjointView<Eigen::Lower>() * ordered;
  VectorX forces = VectorX::Zero(coefficients.size());
  for (Eigen::Index k = 0; k < std::ssize(elastic_order); ++k)
    forces.segment<3>(3 * static_cast<Eigen::Index>(elastic_order[k])) = product.segment<3>(3 * k);
  const auto add = [&](const CellShapes& cell, double sign) {
    for (int q = 0; q < cell.points; ++q) {
      const double* x = cell.gradients.data() + static_cast<std::ptrdiff_t>(3 * q) * cell.stride;
      const double *y = x + cell.stride, *z = y + cell.stride;
      Matrix3 gradient = Matrix3::Zero();
      for (std::size_t k = 0; k < cell.nodes.size(); ++k)
        gradient += coefficients.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) *
                    Eigen::RowVector3d(x[k], y[k], z[k]);
      const Matrix3 stress = sign * stress_from_gradient(problem.material, gradient);
      for (std::size_t k = 0; k < cell.nodes.size(); ++k)
        forces.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) += stress * Vector3(x[k], y[k], z[k]);
    }
  };
  for (const Box& box : boxes)
    if (box.exchanged) {
      for (const CellShapes& cell : box.first)
        add(cell, -1);
      for (const CellShapes& cell : box.cells)
        add(cell, 1);
    }
  return forces;
}

void GrowingCut::State::condense_contact() {
  const auto count = static_cast<Eigen::Index>(contact.size());
  MatrixX functionals = MatrixX::Zero(window->slots(), 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (std::size_t k = 0; k < contact[c].nodes.size(); ++k)
      for (int a = 0; a < 3; ++a)
        functionals(3 * slot[contact[c].nodes[k]] + a, 3 * c + a) += contact[c].weights[k];
  SchurWindow::Condensed condensed = window->condense(functionals, window_right(loads));
  compliance = std::move(condensed.compliance);
  base = std::move(condensed.response);
}

GrowingCut::GrowingCut(Problem problem, GrowthOptions options)
    : state_(std::make_unique<State>(std::move(problem), std::move(options))) {
  state_->condense_all();
  state_->options.method.estimate_condition = false; // once is enough
}

GrowingCut::~GrowingCut() = default;

GrowthReport GrowingCut::condense_anew(topology::SurfaceMesh way) {
  const Stopwatch watch;
  auto fresh = std::make_unique<State>(state_->problem, state_->options);
  fresh->options.way = std::move(way);
  fresh->removed = state_->removed;
  fresh->condense_all();
  state_ = std::move(fresh);
  GrowthReport report;
  report.condensed_anew = true;
  report.reason = "asked for";
  report.window_nodes = state_->window->slots() / 3 - state_->options.room;
  report.total_seconds = watch.seconds();
  return report;
}

GrowthReport GrowingCut::grow(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision,
                              const std::function<topology::SurfaceMesh()>& way_ahead) {
  const Stopwatch total;
  GrowthReport report;
  State& s = *state_;
  if (incision == nullptr)
    throw InputError("a growing cut needs an incision");
  for (int node : change.removed)
    if (node < 0 || node >= s.problem.nodes.size() || s.removed[node] != 0)
      throw InputError(fmt::format("node {} cannot be removed: it is not there", node));

  const auto anew = [&](const char* reason, Problem problem, std::vector<char> removed, bool is_overwritten = false) {
    auto fresh = std::make_unique<State>(std::move(problem), s.options);
    fresh->removed = std::move(removed);
    if (way_ahead && !is_overwritten) // it may look at the body as it was
      if (topology::SurfaceMesh way = way_ahead(); !way.triangles.empty())
        fresh->options.way = std::move(way);
    fresh->condense_all();
    state_ = std::move(fresh);
    report.condensed_anew = true;
    report.reason = reason;
    report.window_nodes = state_->window->slots() / 3 - state_->options.room;
    report.total_seconds = total.seconds();
    return report;
  };

  Problem next = s.problem;
  std::vector<char> removed = s.removed;
  for (int node : change.removed) {
    removed[node] = 1;
    next.nodes.kinds[node] = NodeKind::interior; // it has no share of the surface any more
  }
  for (int k = 0; k < change.added.size(); ++k)
    next.nodes.add(change.added.positions[k], change.added.spacings[k], change.added.kinds[k], change.added.normals[k]);
  removed.resize(next.nodes.size(), 0);
  const std::shared_ptr<const topology::Incision> before = s.problem.incision;
  next.incision = incision;
  if (change.prescribed)
    next.prescribed = *change.prescribed;
  if (change.loads)
    next.loads = *change.loads;
  for (const Prescribed& entry : next.prescribed)
    if (entry.node < 0 || entry.node >= next.nodes.size() || removed[entry.node] != 0)
      throw InputError(fmt::format("node {} is prescribed; the cut cannot remove it", entry.node));
  if (!continues(before.get(), *incision))
    return anew("the sheets do not continue those before", std::move(next), std::move(removed));
  if (s.next_room + change.added.size() > s.window->contact_begin() / 3)
    return anew("no room for the added nodes", std::move(next), std::move(removed));
  for (int node : change.removed)
    if (s.slot[node] < 0)
      return anew("a removed node lies outside the window", std::move(next), std::move(removed));

  // New spheres; the state changes only when all touched cells are known to lie in the window.
  const Stopwatch sphere_watch;
  const std::vector<double> old_radii = s.spheres->radii();
  auto fresh_spheres =
      std::make_unique<Spheres>(next.nodes.positions, next.nodes.spacings, s.rho, Basis::linear, worst_moment_condition,
                                sight_about_cut(next, s.options.method.sight), removed);
  std::vector<int> changed_nodes = change.removed;
  for (int i = 0; i < next.nodes.size(); ++i)
    if (i >= std::ssize(old_radii) || (removed[i] == 0 && old_radii[i] != fresh_spheres->radii()[i]))
      changed_nodes.push_back(i);
  report.spheres_seconds = sphere_watch.seconds();

  const Stopwatch cell_watch;
  const double finest = *std::min_element(next.nodes.spacings.begin(), next.nodes.spacings.end());
  const double slack = 0.25 * finest;
  const Changes changes = changes_between(before.get(), SpacingAt(s.problem.nodes, s.removed), *incision,
                                          SpacingAt(next.nodes, removed), 2 * slack);
  std::vector<int> new_slot = s.slot;
  for (int k = 0; k < change.added.size(); ++k)
    new_slot.push_back(s.next_room + k);
  std::vector<std::pair<int, State::Box>> exchanged;
  CellEvaluator evaluator(*fresh_spheres);
  BackgroundCells filled;
  BoundingBox touched{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
  const auto include = [&](const Vector3& x, double reach) {
    touched.lower = touched.lower.cwiseMin((x.array() - reach).matrix());
    touched.upper = touched.upper.cwiseMax((x.array() + reach).matrix());
  };
  const double largest = std::max(*std::max_element(old_radii.begin(), old_radii.end()),
                                  *std::max_element(fresh_spheres->radii().begin(), fresh_spheres->radii().end()));
  for (const Vector3& x : changes.faces)
    include(x, largest);
  for (const Vector3& x : changes.front)
    include(x, largest * std::max(1.0, s.enrichment_reach()));
  std::vector<double> radii = fresh_spheres->radii();
  for (std::size_t i = 0; i < old_radii.size(); ++i)
    radii[i] = std::max(radii[i], old_radii[i]);
  std::vector<Vector3> all_front = changes.front;
  add_front(before.get(), 2 * slack, all_front);
  add_front(incision.get(), 2 * slack, all_front);
  const Reach reach(changes.faces, changes.front, all_front, s.enrichment_reach(), next.nodes.positions, radii, slack);
  std::vector<std::pair<Vector3, double>> balls;
  for (int i : changed_nodes) {
    const double radius = std::max(i < std::ssize(old_radii) ? old_radii[i] : 0.0, fresh_spheres->radii()[i]);
    balls.emplace_back(next.nodes.positions[i], radius);
    include(next.nodes.positions[i], radius);
  }
  const char* outside = nullptr;
  for (int b = 0; b < std::ssize(s.boxes) && outside == nullptr; ++b) {
    const BackgroundBox& leaf = s.boxes[b].box;
    if (((leaf.centre - touched.lower).array() < -leaf.half.array()).any() ||
        ((touched.upper - leaf.centre).array() < -leaf.half.array()).any())
      continue;
    const double half = leaf.half.norm();
    const bool is_touched =
        reach.sees(leaf.centre, half) || reach.near_front(leaf.centre, half, std::max(1.0, s.enrichment_reach())) ||
        std::any_of(balls.begin(), balls.end(),
                    [&](const auto& ball) { return (ball.first - leaf.centre).norm() < ball.second + half; });
    if (!is_touched)
      continue;
    State::Box box{leaf, {}, {}};
    refill_box(*next.domain, leaf, s.background(), incision.get(), filled);
    s.evaluate(box, filled, evaluator);
    if (s.boxes[b].cells.empty())
      outside = "the cut left the predicted way";
    for (const State::Box* one : {&std::as_const(box), &std::as_const(s.boxes[b])})
      for (const CellShapes& cell : one->cells)
        for (int node : cell.nodes)
          if (new_slot[node] < 0)
            outside = "the cut left the predicted way";
    exchanged.emplace_back(b, std::move(box));
  }
  // The same for means over the surface: those whose points see the change have new weights, and where the faces or
  // surface nodes come near the shares themselves are new.
  const auto is_near = [&](const DisplacementMean& mean) {
    const double share = 0.5 * s.radius_at(mean.centroid);
    return reach.sees(mean.centroid, share) ||
           reach.near_front(mean.centroid, share, std::max(1.0, s.enrichment_reach())) ||
           std::any_of(balls.begin(), balls.end(),
                       [&](const auto& ball) { return (ball.first - mean.centroid).norm() < ball.second + share; });
  };
  std::vector<Vector3> surface_changes = changes.faces;
  for (int node : change.removed)
    if (s.problem.nodes.kinds[node] != NodeKind::interior)
      surface_changes.push_back(s.problem.nodes.positions[node]);
  for (int k = 0; k < change.added.size(); ++k)
    if (change.added.kinds[k] != NodeKind::interior)
      surface_changes.push_back(change.added.positions[k]);
  const Nearness to_surface_changes(surface_changes);
  const auto is_reshaped = [&](const DisplacementMean& mean, int node) {
    return to_surface_changes(mean.centroid) < share_size * s.problem.nodes.spacings[node];
  };
  std::vector<DisplacementMean> held = s.held;
  std::unique_ptr<Shares> shares;
  bool reshaped = !std::equal(
      next.prescribed.begin(), next.prescribed.end(), s.problem.prescribed.begin(), s.problem.prescribed.end(),
      [](const Prescribed& a, const Prescribed& b) { return a.node == b.node && a.components == b.components; });
  for (std::size_t k = 0; k < held.size() && !reshaped; ++k)
    reshaped = is_reshaped(held[k], s.problem.prescribed[k].node);
  if (reshaped) {
    shares = std::make_unique<Shares>(next, removed);
    held = held_means(next, *fresh_spheres, *shares);
  } else {
    for (DisplacementMean& mean : held)
      if (is_near(mean))
        if (DisplacementMean weighed = reweighed(mean, *fresh_spheres); !equal_to_rounding(mean, weighed))
          mean = std::move(weighed);
  }
  const std::vector<HeldChange> exchanged_means = held_changes(s.problem.prescribed, s.held, next.prescribed, held);
  for (const HeldChange& one : exchanged_means)
    for (const DisplacementMean* mean :
         {one.before < 0 ? nullptr : &s.held[one.before], one.now < 0 ? nullptr : &held[one.now]})
      if (mean != nullptr)
        for (int node : mean->nodes)
          if (new_slot[node] < 0)
            outside = "the cut came to the held region";
  if (outside != nullptr)
    return anew(outside, std::move(next), std::move(removed));

  // Exchange.
  const Eigen::Index grown = 3 * static_cast<Eigen::Index>(next.nodes.size());
  s.cell_loads.conservativeResizeLike(VectorX::Zero(grown));
  for (int k = 0; k < change.added.size(); ++k) {
    const int block = s.next_room + k;
    for (int c = 0; c < 3; ++c)
      s.window->activate(3 * block + c);
    s.window_node[block] = s.problem.nodes.size() + k;
  }
  s.next_room += change.added.size();
  s.slot = std::move(new_slot);
  CellEvaluator numbering(*fresh_spheres);
  CellShapes by_slot;
  for (auto& exchange : exchanged) {
    const int b = exchange.first;
    State::Box& box = exchange.second;
    s.add_cell_loads(s.boxes[b], -1, *s.spheres, s.cell_loads);
    // A cell that came out as it was cancels itself.
    const std::vector<CellShapes>& old_cells = s.boxes[b].cells;
    const auto is_same = [&](std::size_t c) {
      return c < old_cells.size() && c < box.cells.size() && old_cells[c].nodes == box.cells[c].nodes &&
             old_cells[c].gradients == box.cells[c].gradients;
    };
    for (std::size_t c = 0; c < old_cells.size(); ++c)
      if (!is_same(c))
        s.scatter(old_cells[c], -1, numbering, by_slot);
    for (std::size_t c = 0; c < box.cells.size(); ++c)
      if (!is_same(c))
        s.scatter(box.cells[c], 1, numbering, by_slot);
    if (box.exchanged = true; s.boxes[b].exchanged)
      box.first = std::move(s.boxes[b].first);
    else
      box.first = std::move(s.boxes[b].cells);
    s.boxes[b] = std::move(box);
    s.add_cell_loads(s.boxes[b], 1, *fresh_spheres, s.cell_loads);
  }
  for (const HeldChange& one : exchanged_means) {
    if (one.before >= 0)
      s.scatter(s.held[one.before], s.problem, s.problem.prescribed[one.before], -1);
    if (one.now >= 0)
      s.scatter(held[one.now], next, next.prescribed[one.now], 1);
  }
  s.held = std::move(held);
  for (int node : change.removed) {
    for (int c = 0; c < 3; ++c)
      s.window->deactivate(3 * s.slot[node] + c);
    s.window_node[s.slot[node]] = -1;
    s.cell_loads.segment<3>(3 * static_cast<Eigen::Index>(node)).setZero();
  }
  Problem previous = std::move(s.problem);
  std::vector<char> previously_removed = std::move(s.removed);
  s.problem = std::move(next);
  s.removed = std::move(removed);
  s.spheres = std::move(fresh_spheres);
  s.shares = std::move(shares);
  s.find_loads();
  report.boxes = static_cast<int>(exchanged.size());
  report.cells_seconds = cell_watch.seconds();

  try {
    const Stopwatch factor_watch;
    report.prepared = s.window->factor();
    report.factored = s.window->factored();
    report.factor_seconds = factor_watch.seconds();
    const Stopwatch condense_watch;
    bool contact_reshaped = false;
    for (std::size_t c = 0; c < s.contact.size(); ++c)
      contact_reshaped = contact_reshaped || is_reshaped(s.contact[c], s.options.contact[c]);
    if (contact_reshaped)
      s.find_contact();
    else
      for (DisplacementMean& mean : s.contact)
        if (is_near(mean))
          mean = reweighed(mean, *s.spheres);
    s.condense_contact();
    report.condense_seconds = condense_watch.seconds();
  } catch (const NumericalError&) {
    // A piece that nothing holds, or a support gone bad: the ordinary way deals with it or says what is wrong; then
    // the body before is condensed again, for this one has been overwritten.
    Problem wanted = s.problem;
    std::vector<char> wanted_removed = s.removed;
    try {
      return anew("the window became singular", std::move(wanted), std::move(wanted_removed), true);
    } catch (...) {
      auto back = std::make_unique<State>(std::move(previous), s.options);
      back->removed = std::move(previously_removed);
      back->condense_all();
      state_ = std::move(back);
      throw;
    }
  }
  report.window_nodes =
      static_cast<int>(std::count_if(s.window_node.begin(), s.window_node.end(), [](int node) { return node >= 0; }));
  report.total_seconds = total.seconds();
  return report;
}

double GrowingCut::prepare(const topology::SurfaceMesh& next) {
  const Stopwatch watch;
  State& s = *state_;
  std::vector<char> kept(s.window->slots(), 0);
  const auto keep = [&](int node) {
    if (const int block = s.slot[node]; block >= 0)
      std::fill_n(kept.begin() + 3 * static_cast<std::ptrdiff_t>(block), 3, 1);
  };
  const auto in_reach = s.reach_of(next, false);
  for (const State::Box& box : s.boxes)
    if (!box.cells.empty() && in_reach(box.box.centre, box.box.half.norm()))
      for (const CellShapes& cell : box.cells)
        for (int node : cell.nodes)
          keep(node);
  for (const DisplacementMean& mean : s.held)
    if (in_reach(mean.centroid, 0.5 * s.radius_at(mean.centroid)))
      for (int node : mean.nodes)
        keep(node);
  for (const DisplacementMean& mean : s.contact)
    for (int node : mean.nodes)
      keep(node);
  s.window->prepare(kept);
  return watch.seconds();
}

const Problem& GrowingCut::problem() const {
  return state_->problem;
}
const std::vector<char>& GrowingCut::removed() const {
  return state_->removed;
}
int GrowingCut::window_unknowns() const {
  return 3 * static_cast<int>(std::count_if(state_->window_node.begin(), state_->window_node.end(),
                                            [](int node) { return node >= 0; }));
}
const MatrixX& GrowingCut::compliance() const {
  return state_->compliance;
}
const VectorX& GrowingCut::base_displacement() const {
  return state_->base;
}

const Spheres& GrowingCut::spheres() const {
  return *state_->spheres;
}
const std::vector<DisplacementMean>& GrowingCut::held() const {
  return state_->held;
}
DisplacementMean GrowingCut::mean(int node) const {
  return state_->mean(node);
}
const AssemblyReport& GrowingCut::report() const {
  return state_->report;
}
bool GrowingCut::is_anchored(int node) const {
  return std::any_of(state_->anchors.begin(), state_->anchors.end(),
                     [&](const Anchor& anchor) { return anchor.node == node; });
}
const VectorX& GrowingCut::external_loads() const {
  return state_->external;
}
MatrixX GrowingCut::respond(const MatrixX& forces) const {
  return state_->respond(forces);
}
VectorX GrowingCut::elastic_forces(const VectorX& coefficients) const {
  return state_->elastic_forces(coefficients);
}

VectorX GrowingCut::coefficients(const std::vector<Vector3>& contact_forces) const {
  const State& s = *state_;
  VectorX right = s.loads;
  for (std::size_t c = 0; c < contact_forces.size(); ++c)
    for (std::size_t k = 0; k < s.contact[c].nodes.size(); ++k)
      right.segment<3>(3 * static_cast<Eigen::Index>(s.contact[c].nodes[k])) +=
          s.contact[c].weights[k] * contact_forces[c];
  const MatrixX in_window = s.window->solve(s.window_right(right));
  const int far = s.window->far();
  VectorX ordered = VectorX::Zero(far + s.window->slots() - 3 * static_cast<Eigen::Index>(s.options.room));
  for (Eigen::Index k = 0; k < std::ssize(s.far_order); ++k)
    ordered.segment<3>(3 * k) = s.loads.segment<3>(3 * s.far_order[k]);
  const MatrixX recovered = s.window->recover(in_window, ordered);
  VectorX coefficients = VectorX::Zero(s.loads.size());
  for (Eigen::Index k = 0; k < std::ssize(s.far_order); ++k)
    coefficients.segment<3>(3 * s.far_order[k]) = recovered.col(0).segment<3>(3 * k);
  for (Eigen::Index b = 0; b < std::ssize(s.window_node); ++b)
    if (const int node = s.window_node[b]; node >= 0)
      coefficients.segment<3>(3 * node) = in_window.col(0).segment<3>(3 * b);
  return coefficients;
}

GrowingCut::Scratch GrowingCut::from_scratch(const std::vector<Vector3>& contact_forces) const {
  const State& s = *state_;
  const Problem& problem = s.problem;
  const std::unique_ptr<Spheres> spheres = s.make_spheres();
  const Eigen::Index size = 3 * static_cast<Eigen::Index>(problem.nodes.size());
  MatrixX k = MatrixX::Zero(size, size);
  const double mu = problem.material.shear_modulus(), lambda = problem.material.lame_lambda();
  CellEvaluator evaluator(*spheres);
  BackgroundCells filled;
  CellShapes cell;
  StiffnessColumn column;
  for (const State::Box& box : s.boxes) {
    refill_box(*problem.domain, box.box, s.background(), problem.incision.get(), filled);
    for (int c = 0; c + 1 < std::ssize(filled.start); ++c) {
      evaluator.evaluate(filled.of(c), cell);
      const int count = static_cast<int>(cell.nodes.size());
      for (int own = 0; own < count; ++own) {
        stiffness_column(cell.gradients.data(), cell.points, cell.stride, own, count, own, lambda, mu, column);
        for (int i = own; i < count; ++i)
          for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
              k(3 * cell.nodes[i] + a, 3 * cell.nodes[own] + b) += column.plane[3 * a + b][i];
      }
    }
  }
  const Shares shares(problem, s.removed);
  const std::vector<DisplacementMean> held = held_means(problem, *spheres, shares);
  for (std::size_t p = 0; p < held.size(); ++p) {
    const Prescribed& entry = problem.prescribed[p];
    const double penalty = constraint_stiffness(problem, entry.node);
    for (std::size_t i = 0; i < held[p].nodes.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j)
        for (int c = 0; c < 3; ++c)
          if (entry.components[c])
            k(3 * held[p].nodes[i] + c, 3 * held[p].nodes[j] + c) += penalty * held[p].weights[i] * held[p].weights[j];
  }
  for (Eigen::Index i = 0; i < problem.nodes.size(); ++i)
    if (s.removed[i] != 0)
      k.diagonal().segment<3>(3 * i).setOnes();
  const Eigen::LLT<MatrixX, Eigen::Lower> factor(k);
  if (factor.info() != Eigen::Success)
    throw NumericalError("the system from scratch is not positive definite");
  const auto count = static_cast<Eigen::Index>(s.contact.size());
  MatrixX right = MatrixX::Zero(size, 3 * count + 1);
  std::vector<DisplacementMean> means;
  for (int node : s.options.contact)
    means.push_back(shares.patches.mean(shares.compact[node], *spheres, problem.prescribed_region));
  right.col(3 * count) = s.loads;
  for (Eigen::Index c = 0; c < count; ++c)
    for (std::size_t n = 0; n < means[c].nodes.size(); ++n) {
      for (int a = 0; a < 3; ++a)
        right(3 * means[c].nodes[n] + a, 3 * c + a) += means[c].weights[n];
      if (static_cast<std::size_t>(c) < contact_forces.size())
        right.col(3 * count).segment<3>(3 * static_cast<Eigen::Index>(means[c].nodes[n])) +=
            means[c].weights[n] * contact_forces[c];
    }
  const MatrixX solution = factor.solve(right);
  Scratch scratch;
  scratch.compliance.resize(3 * count, 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (Eigen::Index f = 0; f < 3 * count; ++f)
      scratch.compliance.col(f).segment<3>(3 * c) = means[c].of(VectorX(solution.col(f)));
  scratch.coefficients = solution.col(3 * count);
  return scratch;
}

} // namespace spherecut::solvers
