#include "solvers/cut/growing_cut.hpp"

#include "solvers/algebra/parallel.hpp"
#include "solvers/collocation/body.hpp"
#include "solvers/cut/growing_cut_state.hpp"
#include "solvers/shapes/cut_sight.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace spherecut::solvers {

namespace {

/// Of the nodes: a window predicted to hold more than that holds all of them, where one is asked for all the same. The
/// rest costs little to carry along, and no cut leaves its way then.
constexpr double whole_window = 0.85;
/// How far from where its way begins a cut is going to change the system, in spacings.
constexpr double first_reach = 6;
constexpr std::size_t first_part = 5; // one of so many parts of the way is where it begins

} // namespace

double window_share(const Problem& problem, const DiscretisationOptions& method, const topology::SurfaceMesh& way) {
  const std::vector<double>& spacings = problem.nodes.spacings;
  const bool collocates = method.method == Method::collocation;
  const double rho = collocates ? problem.tuning.collocation_front_radius * collocation_support_radius(method)
                                : galerkin_support_radius(problem, method);
  const std::vector<double>& lengths = collocates ? spacings : problem.nodes.*galerkin_lengths(problem.material);
  const double finest = *std::min_element(spacings.begin(), spacings.end());
  const Nearness to_way(sample_points(way, 0, finest));
  // Cells that a change within a sphere of it can reach, and the nodes whose spheres reach those.
  const double reach = (1 + node_margin) * rho * finest + method.cell_size * finest;
  int inside = 0;
  for (std::size_t i = 0; i < spacings.size(); ++i)
    inside += to_way(problem.nodes.positions[i]) < reach + rho * lengths[i] ? 1 : 0;
  return static_cast<double>(inside) / static_cast<double>(spacings.size());
}

GrowingCut::State::State(Problem p, GrowthOptions o) : problem(std::move(p)), options(std::move(o)) {
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

VectorX GrowingCut::State::tractions() const {
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

const DisplacementMean& GrowingCut::State::mean(int node) const {
  if (removed[node] != 0)
    throw InputError(fmt::format("node {} has been removed by the cut", node));
  const auto candidate = std::find(options.contact.begin(), options.contact.end(), node);
  if (candidate != options.contact.end())
    return contact[static_cast<std::size_t>(candidate - options.contact.begin())];
  auto known = means.find(node);
  if (known == means.end()) {
    // After an increment the lips are asked for, step by step: their shares are on the faces, and need no skin.
    const bool of_lip = problem.nodes.kinds[node] == NodeKind::lip;
    std::unique_ptr<Shares>& known_shares = shares != nullptr || !of_lip ? shares : lip_shares;
    if (known_shares == nullptr)
      known_shares = std::make_unique<Shares>(problem, removed, std::nullopt,
                                              of_lip ? SurfacePatches::Of::faces : SurfacePatches::Of::skin_and_faces);
    known =
        means.emplace(node, known_shares->patches.contact_mean(known_shares->compact[node], *spheres, problem)).first;
  }
  return known->second;
}

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
  const bool is_whole = window_share(present, options.method, options.way) > whole_window;
  const std::unique_ptr<Discretisation> body = assemble_galerkin(std::move(present), options.method);
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
  altered.assign(problem.nodes.size(), 1);
  shares.reset();
  lip_shares.reset();
  means.clear();
  held = stiffness.held;
  for (DisplacementMean& mean : held)
    for (int& node : mean.nodes)
      node = id[node]; // ascending still
  const std::vector<char> in_window = keep_cells(stiffness, id, is_whole);
  cell_loads = VectorX::Zero(3 * static_cast<Eigen::Index>(problem.nodes.size()));
  for (Eigen::Index i = 0; i < std::ssize(id); ++i)
    cell_loads.segment<3>(3 * static_cast<Eigen::Index>(id[i])) = stiffness.loads.segment<3>(3 * i);
  cell_loads -= tractions();
  drop_removed_contact();
  std::vector<std::size_t> all_candidates(options.contact.size());
  std::iota(all_candidates.begin(), all_candidates.end(), std::size_t{0});
  find_contact(all_candidates);

  const std::vector<int> order = open_window(stiffness, id, in_window); // ids, rank by rank
  find_loads();
  first_loads = loads;
  VectorX ordered(3 * std::ssize(order));
  for (Eigen::Index k = 0; k < std::ssize(order); ++k)
    ordered.segment<3>(3 * k) = first_loads.segment<3>(3 * order[k]);
  reduced_first = window->reduce(ordered);
  std::vector<Vector3> begin; // of the way
  for (std::size_t t = 0; t < options.way.triangles.size() / first_part + 1; ++t)
    for (const int corner : options.way.triangles[t])
      begin.push_back(options.way.vertices[corner]);
  factor_window(begin, first_reach * *std::min_element(problem.nodes.spacings.begin(), problem.nodes.spacings.end()));
  condense_contact();
}

/// The boxes of the body, with the cells of those that the way may reach (`is_whole`: of all). `id`: of the compact
/// nodes. Which nodes these cells see.
std::vector<char> GrowingCut::State::keep_cells(const OrderedStiffness& stiffness, const std::vector<int>& id,
                                                bool is_whole) {
  boxes.clear();
  std::vector<char> in_window(problem.nodes.size(), 0);
  const auto in_reach = reach_of(options.way, true);
  for (const BackgroundBox& leaf : stiffness.cells.boxes) {
    Box box{leaf, {}, {}};
    for (int c = leaf.first_cell; c < leaf.last_cell; ++c)
      box.include(stiffness.cells.of(c));
    box.find_growth(std::span(stiffness.shapes)
                        .subspan(static_cast<std::size_t>(leaf.first_cell),
                                 static_cast<std::size_t>(leaf.last_cell - leaf.first_cell)));
    if (is_whole || in_reach(leaf.centre, leaf.half.norm() + growth_room(leaf.centre, box.growth)))
      for (int c = leaf.first_cell; c < leaf.last_cell; ++c) {
        box.cells.push_back(stiffness.shapes[static_cast<std::size_t>(c)]);
        for (int& node : box.cells.back().nodes)
          node = id[node]; // ascending still
        box.points.emplace_back(stiffness.cells.of(c).begin(), stiffness.cells.of(c).end());
        for (int node : box.cells.back().nodes)
          in_window[node] = 1;
      }
    boxes.push_back(std::move(box));
  }
  return in_window;
}

/// Opens the window on the far nodes in the order that the ordinary factorisation found good, then those in the window,
/// then those of the contact. The ids in that order.
std::vector<int> GrowingCut::State::open_window(const OrderedStiffness& stiffness, const std::vector<int>& id,
                                                const std::vector<char>& in_window) {
  std::vector<char> in_contact(problem.nodes.size(), 0);
  for (const DisplacementMean& mean : contact)
    for (int node : mean.nodes)
      in_contact[node] = 1;
  const auto place_of = [&](int node) { return in_contact[node] != 0 ? 2 : in_window[node] != 0 ? 1 : 0; };
  std::vector<int> order, new_rank(stiffness.order.size());
  std::array<int, 3> count{};
  for (int place = 0; place < 3; ++place)
    for (int rank = 0; rank < std::ssize(stiffness.order); ++rank)
      if (const int node = id[stiffness.order[rank]]; place_of(node) == place) {
        new_rank[rank] = static_cast<int>(order.size());
        order.push_back(node);
        ++count[place];
      }
  Eigen::PermutationMatrix<Eigen::Dynamic> permutation(3 * std::ssize(order));
  for (Eigen::Index rank = 0; rank < std::ssize(order); ++rank)
    for (int c = 0; c < 3; ++c)
      permutation.indices()[3 * rank + c] = 3 * new_rank[static_cast<std::size_t>(rank)] + c;
  SparseMatrix permuted(stiffness.lower.rows(), stiffness.lower.cols());
  permuted.selfadjointView<Eigen::Lower>() = stiffness.lower.selfadjointView<Eigen::Lower>().twistedBy(permutation);

  const int changing = count[1], contact_nodes = count[2];
  const Stopwatch factor_watch;
  window = std::make_unique<SchurWindow>(permuted, 3 * changing, 3 * options.room, 3 * contact_nodes);
  report.factor_seconds = factor_watch.seconds();
  report.factor_nonzeros = window->factor_nonzeros();
  if (options.method.estimate_condition) {
    report.condition_estimate = window->condition_estimate();
    require_regular(report);
  }
  slot.assign(problem.nodes.size(), -1);
  window_node.assign(static_cast<std::size_t>(window->slots() / 3), -1);
  left_alone.assign(window_node.size(), 0);
  far_order.clear();
  for (int k = 0; k < std::ssize(order); ++k) {
    const int node = order[k], s = window->slot_of(3 * k);
    if (s < 0) {
      far_order.push_back(node);
    } else {
      slot[node] = s / 3;
      window_node[s / 3] = node;
    }
  }
  next_room = changing;
  return order;
}

GrowingCut::GrowingCut(Problem problem, GrowthOptions options)
    : state_(std::make_unique<State>(std::move(problem), std::move(options))) {
  state_->condense_all();
}

GrowingCut::~GrowingCut() = default;

/// The problem after an increment, and which nodes are gone then. Throws InputError where it names nodes that are not
/// there.
void GrowingCut::State::change_problem(const NodeChange& change,
                                       const std::shared_ptr<const topology::Incision>& incision,
                                       Increment& increment) const {
  if (incision == nullptr)
    throw InputError("a growing cut needs an incision");
  for (int node : change.removed)
    if (node < 0 || node >= problem.nodes.size() || removed[node] != 0)
      throw InputError(fmt::format("node {} cannot be removed: it is not there", node));
  Problem& next = increment.next = problem;
  std::vector<char>& gone = increment.removed = removed;
  for (int node : change.removed) {
    gone[node] = 1;
    next.nodes.kinds[node] = NodeKind::interior; // it has no share of the surface any more
  }
  for (int k = 0; k < change.added.size(); ++k)
    next.nodes.add(change.added, k);
  gone.resize(next.nodes.size(), 0);
  next.incision = incision;
  if (change.prescribed)
    next.prescribed = *change.prescribed;
  if (change.loads)
    next.loads = *change.loads;
  for (const Prescribed& entry : next.prescribed)
    if (entry.node < 0 || entry.node >= next.nodes.size() || gone[entry.node] != 0)
      throw InputError(fmt::format("node {} is prescribed; the cut cannot remove it", entry.node));
}

/// The spheres after an increment, and what of spheres, faces and front changes.
void GrowingCut::State::find_changes(const NodeChange& change, Increment& increment) const {
  const Problem& next = increment.next;
  const std::vector<char>& gone = increment.removed;
  const topology::Incision *const before = problem.incision.get(), *const incision = next.incision.get();
  const Stopwatch sphere_watch;
  const std::vector<double>& old_radii = spheres->radii();
  increment.spheres = std::make_unique<Spheres>(
      next.nodes.positions, next.nodes.*galerkin_lengths(next.material), rho, Basis::linear, worst_moment_condition,
      sight_about_cut(next, Method::galerkin, options.method.sight), gone, spheres.get());
  std::vector<double> radii = increment.spheres->radii();
  std::vector<int> changed_nodes = change.removed;
  for (int i = 0; i < next.nodes.size(); ++i)
    if (i >= std::ssize(old_radii) || (gone[i] == 0 && old_radii[i] != radii[i]))
      changed_nodes.push_back(i);
  increment.spheres_seconds = sphere_watch.seconds();

  const double finest = *std::min_element(next.nodes.spacings.begin(), next.nodes.spacings.end());
  const double slack = 0.1 * finest;
  const Changes& changes = increment.changes =
      changes_between(before, SpacingAt(problem.nodes, removed, galerkin_lengths(problem.material)), *incision,
                      SpacingAt(next.nodes, gone, galerkin_lengths(next.material)), 2 * slack);
  for (std::size_t i = 0; i < old_radii.size(); ++i)
    radii[i] = std::max(radii[i], old_radii[i]);
  const double largest = *std::max_element(radii.begin(), radii.end());
  for (const Vector3& x : changes.faces)
    increment.include(x, 1.1 * largest + 2 * slack);
  // The branch functions at a node are those of the front nearest to it: an enriched point that sees a node which has
  // lost its front, or found a new one.
  const double enriched = enrichment_reach();
  for (const Vector3& x : changes.front)
    increment.include(x, largest * (enriched > 0 ? enriched + 2 : 1.1) + 2 * slack);
  std::vector<Vector3> all_front = changes.front;
  add_front(before, 2 * slack, all_front);
  add_front(incision, 2 * slack, all_front);
  increment.reach.emplace(changes.faces, changes.front, all_front, enrichment_reach(), next.nodes.positions, radii,
                          slack, known_change(before, *incision, *spheres, *increment.spheres));
  for (int i : changed_nodes) {
    increment.balls.emplace_back(next.nodes.positions[i], radii[i]);
    increment.include(next.nodes.positions[i], radii[i]);
  }
}

/// What an increment would change, before any cell is evaluated. Throws InputError where it names nodes that are not
/// there.
GrowingCut::State::Increment
GrowingCut::State::increment(const NodeChange& change,
                             const std::shared_ptr<const topology::Incision>& incision) const {
  Increment increment;
  change_problem(change, incision, increment);
  const auto uncovered = [&](const char* why) {
    increment.uncovered = why;
    return std::move(increment);
  };
  if (!continues(problem.incision.get(), *incision))
    return uncovered("the sheets do not continue those before");
  if (next_room + change.added.size() > window->contact_begin() / 3)
    return uncovered("no room for the added nodes");
  for (int node : change.removed)
    if (slot[node] < 0)
      return uncovered("a removed node lies outside the window");

  find_changes(change, increment);
  const BoundingBox& touched = increment.touched;
  for (int b = 0; b < std::ssize(boxes); ++b) {
    const BackgroundBox& leaf = boxes[b].box;
    const double room = growth_room(leaf.centre, boxes[b].growth);
    if (((leaf.centre - touched.lower).array() < -(leaf.half.array() + room)).any() ||
        ((touched.upper - leaf.centre).array() < -(leaf.half.array() + room)).any())
      continue;
    const bool moved = increment.reach->moves_points(leaf.centre, leaf.half);
    if (!moved && !increment.concerns(boxes[b], room))
      continue;
    if (boxes[b].cells.empty())
      return uncovered("the cut left the predicted way");
    for (int k = 0; k < change.added.size(); ++k)
      if (is_too_large(leaf, change.added.positions[k], change.added.spacings[k], background()))
        return uncovered("the added nodes are finer than the cells");
    increment.boxes.push_back(b);
    increment.moved.push_back(moved ? 1 : 0);
  }
  return increment;
}

/// The boxes that an increment touches as they are after it.
std::vector<GrowingCut::State::Box> GrowingCut::State::evaluated(const Increment& increment) const {
  std::vector<Box> fresh_boxes(increment.boxes.size());
  const SharedSightTime shared_sight;
  parallel_ranges(static_cast<int>(fresh_boxes.size()), 16, [&](int begin, int end) {
    const SharedSightTime::Part timed(shared_sight);
    CellEvaluator evaluator(*increment.spheres);
    BackgroundCells filled;
    for (int k = begin; k < end; ++k) {
      Box& fresh = fresh_boxes[k];
      const Box& old = boxes[increment.boxes[k]];
      fresh.box = old.box;
      if (increment.moved[k] != 0) {
        refill_box(*increment.next.domain, fresh.box, background(), increment.next.incision.get(), filled);
        for (int c = 0; c + 1 < std::ssize(filled.start); ++c) {
          fresh.points.emplace_back(filled.of(c).begin(), filled.of(c).end());
          fresh.include(filled.of(c));
        }
      } else {
        fresh.points = old.points;
        fresh.extent = old.extent;
      }
      evaluate(fresh, evaluator);
    }
  });
  return fresh_boxes;
}

void GrowingCut::State::find_altered(const Increment& increment) {
  const std::vector<Vector3>& positions = increment.next.nodes.positions;
  const double enriched = enrichment_reach();
  const auto known = std::ssize(altered);
  altered.assign(positions.size(), 1);
  for (Eigen::Index i = 0; i < known; ++i) {
    const double room = 0.01 * increment.next.nodes.spacings[i]; // a point on the cut is seen from beside it
    if (((positions[i] - increment.touched.lower).array() < -room).any() ||
        ((increment.touched.upper - positions[i]).array() < -room).any()) {
      altered[i] = 0;
      continue;
    }
    altered[i] = increment.concerns(positions[i], room, enriched) ||
                         increment.reach->at_front(positions[i], Vector3::Constant(room))
                     ? 1
                     : 0;
  }
}

/// Cells of a box that are not as they were, and what they were. One that came out as it was cancels itself.
void GrowingCut::State::find_changed(const Box& before, const Box& after, std::vector<const CellShapes*>& gone,
                                     std::vector<const CellShapes*>& come) {
  const std::size_t common = std::min(before.cells.size(), after.cells.size());
  const auto is_same = [&](std::size_t c) {
    return c < common && before.cells[c].nodes == after.cells[c].nodes &&
           before.cells[c].gradients == after.cells[c].gradients;
  };
  for (std::size_t c = 0; c < before.cells.size(); ++c)
    if (!is_same(c))
      gone.push_back(&before.cells[c]);
  for (std::size_t c = 0; c < after.cells.size(); ++c)
    if (!is_same(c))
      come.push_back(&after.cells[c]);
}

double GrowingCut::prepare(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision) {
  const Stopwatch watch;
  State& s = *state_;
  const State::Increment next = s.increment(change, incision);
  if (next.uncovered != nullptr)
    return watch.seconds();
  std::vector<char> kept(s.window->slots(), 0);
  const auto keep = [&](int node) {
    if (const int block = node < std::ssize(s.slot) ? s.slot[node] : -1; block >= 0)
      std::fill_n(kept.begin() + 3 * static_cast<std::ptrdiff_t>(block), 3, 1);
  };
  const std::vector<State::Box> boxes = s.evaluated(next);
  std::vector<const CellShapes*> changed;
  for (std::size_t k = 0; k < boxes.size(); ++k)
    State::find_changed(s.boxes[next.boxes[k]], boxes[k], changed, changed);
  for (const CellShapes* cell : changed)
    for (const int node : cell->nodes)
      keep(node);
  for (const DisplacementMean& mean : s.held)
    if (s.is_concerned(mean, next))
      if (const DisplacementMean weighed = reweighed(mean, *next.spheres); !equal_to_rounding(mean, weighed))
        for (const DisplacementMean* one : {&mean, &weighed})
          for (const int node : one->nodes)
            keep(node);
  s.window->prepare({std::move(kept)});
  s.is_prepared = true;
  s.window->see_ahead(s.contact_functionals(), s.window_right(s.loads));
  return watch.seconds();
}

} // namespace spherecut::solvers
