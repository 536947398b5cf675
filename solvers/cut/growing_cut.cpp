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
  const double rho =
      collocates ? front_radius_factor * collocation_support_radius(method) : galerkin_support_radius(problem, method);
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
  cell_loads = VectorX::Zero(3 * static_cast<Eigen::Index>(problem.nodes.size()));
  for (Eigen::Index i = 0; i < std::ssize(id); ++i)
    cell_loads.segment<3>(3 * static_cast<Eigen::Index>(id[i])) = stiffness.loads.segment<3>(3 * i);
  cell_loads -= tractions();
  drop_removed_contact();
  std::vector<std::size_t> all_candidates(options.contact.size());
  std::iota(all_candidates.begin(), all_candidates.end(), std::size_t{0});
  find_contact(all_candidates);
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
  std::vector<Vector3> begin; // of the way
  for (std::size_t t = 0; t < options.way.triangles.size() / first_part + 1; ++t)
    for (const int corner : options.way.triangles[t])
      begin.push_back(options.way.vertices[corner]);
  factor_window(begin, first_reach * *std::min_element(problem.nodes.spacings.begin(), problem.nodes.spacings.end()));
  condense_contact();
}

GrowingCut::GrowingCut(Problem problem, GrowthOptions options)
    : state_(std::make_unique<State>(std::move(problem), std::move(options))) {
  state_->condense_all();
}

GrowingCut::~GrowingCut() = default;

/// What an increment would change, before any cell is evaluated. Throws InputError where it names nodes that are not
/// there.
GrowingCut::State::Increment
GrowingCut::State::increment(const NodeChange& change,
                             const std::shared_ptr<const topology::Incision>& incision) const {
  if (incision == nullptr)
    throw InputError("a growing cut needs an incision");
  for (int node : change.removed)
    if (node < 0 || node >= problem.nodes.size() || removed[node] != 0)
      throw InputError(fmt::format("node {} cannot be removed: it is not there", node));

  Increment increment;
  Problem& next = increment.next = problem;
  std::vector<char>& gone = increment.removed = removed;
  for (int node : change.removed) {
    gone[node] = 1;
    next.nodes.kinds[node] = NodeKind::interior; // it has no share of the surface any more
  }
  for (int k = 0; k < change.added.size(); ++k)
    next.nodes.add(change.added, k);
  gone.resize(next.nodes.size(), 0);
  const topology::Incision* const before = problem.incision.get();
  next.incision = incision;
  if (change.prescribed)
    next.prescribed = *change.prescribed;
  if (change.loads)
    next.loads = *change.loads;
  for (const Prescribed& entry : next.prescribed)
    if (entry.node < 0 || entry.node >= next.nodes.size() || gone[entry.node] != 0)
      throw InputError(fmt::format("node {} is prescribed; the cut cannot remove it", entry.node));
  const auto uncovered = [&](const char* why) {
    increment.uncovered = why;
    return std::move(increment);
  };
  if (!continues(before, *incision))
    return uncovered("the sheets do not continue those before");
  if (next_room + change.added.size() > window->contact_begin() / 3)
    return uncovered("no room for the added nodes");
  for (int node : change.removed)
    if (slot[node] < 0)
      return uncovered("a removed node lies outside the window");

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
  BoundingBox& touched = increment.touched;
  const auto include = [&](const Vector3& x, double reach) {
    touched.lower = touched.lower.cwiseMin((x.array() - reach).matrix());
    touched.upper = touched.upper.cwiseMax((x.array() + reach).matrix());
  };
  const double largest = *std::max_element(radii.begin(), radii.end());
  for (const Vector3& x : changes.faces)
    include(x, 1.1 * largest + 2 * slack);
  // The branch functions at a node are those of the front nearest to it: an enriched point that sees a node which has
  // lost its front, or found a new one.
  const double enriched = enrichment_reach();
  for (const Vector3& x : changes.front)
    include(x, largest * (enriched > 0 ? enriched + 2 : 1.1) + 2 * slack);
  std::vector<Vector3> all_front = changes.front;
  add_front(before, 2 * slack, all_front);
  add_front(incision.get(), 2 * slack, all_front);
  increment.reach.emplace(changes.faces, changes.front, all_front, enrichment_reach(), next.nodes.positions, radii,
                          slack, known_change(before, *incision, *spheres, *increment.spheres));
  for (int i : changed_nodes) {
    increment.balls.emplace_back(next.nodes.positions[i], radii[i]);
    include(next.nodes.positions[i], radii[i]);
  }
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

GrowthReport GrowingCut::grow(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision,
                              const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) {
  const Stopwatch total;
  GrowthReport report;
  State& s = *state_;
  const auto anew = [&](const char* reason, Problem problem, std::vector<char> removed, bool is_overwritten = false) {
    report.reason = reason;
    if (only_update && !is_overwritten) {
      report.declined = true;
      return report;
    }
    auto fresh = std::make_unique<State>(std::move(problem), s.options);
    fresh->removed = std::move(removed);
    if (way_ahead && !is_overwritten) // it may look at the body as it was
      if (topology::SurfaceMesh way = way_ahead(); !way.triangles.empty())
        fresh->options.way = std::move(way);
    fresh->condense_all();
    state_ = std::move(fresh);
    report.condensed_anew = true;
    report.window_nodes = state_->window->slots() / 3 - state_->options.room;
    report.total_seconds = total.seconds();
    return report;
  };

  const Stopwatch cell_watch;
  State::Increment increment = s.increment(change, incision);
  report.spheres_seconds = increment.spheres_seconds;
  Problem& next = increment.next;
  std::vector<char>& removed = increment.removed;
  std::unique_ptr<Spheres>& fresh_spheres = increment.spheres;
  const Changes& changes = increment.changes;
  const std::vector<int>& touched_boxes = increment.boxes;
  if (increment.uncovered != nullptr)
    return anew(increment.uncovered, std::move(next), std::move(removed));

  // The state changes only when all touched cells are known to lie in the window.
  const char* outside = nullptr;
  std::vector<int> new_slot = s.slot;
  for (int k = 0; k < change.added.size(); ++k)
    new_slot.push_back(s.next_room + k);
  const auto leaves_window = [&](const State::Box& box) {
    for (const CellShapes& cell : box.cells)
      for (int node : cell.nodes)
        if (new_slot[node] < 0)
          return true;
    return false;
  };
  for (const int box : touched_boxes) // before anything is evaluated in vain
    if (leaves_window(s.boxes[box]))
      return anew("the cut left the predicted way", std::move(next), std::move(removed));
  std::vector<std::pair<int, State::Box>> exchanged;
  std::vector<State::Box> fresh_boxes = s.evaluated(increment);
  for (std::size_t k = 0; k < touched_boxes.size(); ++k) {
    if (leaves_window(fresh_boxes[k]))
      outside = "the cut left the predicted way";
    exchanged.emplace_back(touched_boxes[k], std::move(fresh_boxes[k]));
  }
  // The same for means over the surface: those whose points see the change have new weights, and where the faces or
  // surface nodes come near the shares themselves are new.
  const auto is_near = [&](const DisplacementMean& mean) { return s.is_concerned(mean, increment); };
  std::vector<Vector3> skin_changes, lip_changes = changes.faces;
  const auto add_surface_change = [&](NodeKind kind, const Vector3& x) {
    if (kind == NodeKind::interior)
      return;
    lip_changes.push_back(x); // the points of faces go by the spacing of whatever is nearest
    if (kind != NodeKind::lip)
      skin_changes.push_back(x);
  };
  for (int node : change.removed)
    add_surface_change(s.problem.nodes.kinds[node], s.problem.nodes.positions[node]);
  for (int k = 0; k < change.added.size(); ++k)
    add_surface_change(change.added.kinds[k], change.added.positions[k]);
  const Nearness to_skin_changes(skin_changes), to_lip_changes(lip_changes), to_faces(changes.faces);
  const auto is_reshaped = [&](const DisplacementMean& mean, int node) {
    const double spacing = s.problem.nodes.spacings[node];
    if (s.problem.nodes.kinds[node] == NodeKind::lip)
      return to_lip_changes(mean.centroid) < share_size * spacing;
    if (to_skin_changes(mean.centroid) < share_size * spacing)
      return true;
    // New faces take points away from a node, or give it those of a neighbour, where they come into its share.
    double extent = spacing;
    for (const QuadraturePoint& point : mean.share)
      extent = std::max(extent, (point.position - s.problem.nodes.positions[node]).norm());
    return to_faces(s.problem.nodes.positions[node]) < share_crossing * extent;
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

  s.find_altered(increment);

  // Exchange.
  const Eigen::Index grown = 3 * static_cast<Eigen::Index>(next.nodes.size());
  s.cell_loads.conservativeResizeLike(VectorX::Zero(grown));
  std::vector<int> come_slots, gone_slots;
  for (int k = 0; k < change.added.size(); ++k) {
    const int block = s.next_room + k;
    come_slots.insert(come_slots.end(), {3 * block, 3 * block + 1, 3 * block + 2});
    s.window_node[block] = s.problem.nodes.size() + k;
  }
  s.window->activate(come_slots);
  s.next_room += change.added.size();
  s.slot = std::move(new_slot);
  std::vector<const CellShapes*> gone, come;
  for (const auto& [b, box] : exchanged)
    State::find_changed(s.boxes[b], box, gone, come);
  StiffnessTiles tiles(next.nodes.positions);
  tiles.add_all(gone, -1);
  tiles.add_all(come, 1);
  s.scatter(tiles);
  for (auto& exchange : exchanged) {
    const int b = exchange.first;
    State::Box& box = exchange.second;
    s.add_cell_loads(s.boxes[b], -1, *s.spheres, s.cell_loads);
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
      gone_slots.push_back(3 * s.slot[node] + c);
    s.window_node[s.slot[node]] = -1;
    s.cell_loads.segment<3>(3 * static_cast<Eigen::Index>(node)).setZero();
  }
  s.window->deactivate(gone_slots);
  Problem previous = std::move(s.problem);
  std::vector<char> previously_removed = std::move(s.removed);
  const std::vector<int> previous_candidates = s.options.contact;
  s.problem = std::move(next);
  s.removed = std::move(removed);
  s.spheres = std::move(fresh_spheres);
  s.shares = std::move(shares);
  s.lip_shares.reset();
  s.means.clear(); // where lip nodes are sparse a share reaches farther than can be told from its node
  report.boxes = static_cast<int>(exchanged.size());

  try {
    s.find_loads();
    report.cells_seconds = cell_watch.seconds() - report.spheres_seconds;
    const Stopwatch factor_watch;
    std::vector<Vector3> places = changes.faces;
    places.insert(places.end(), changes.front.begin(), changes.front.end());
    report.prepared = s.factor_window(places);
    report.factored = s.window->factored();
    report.factor_seconds = factor_watch.seconds();
    const Stopwatch condense_watch;
    s.drop_removed_contact();
    std::vector<Vector3> reshaped_places;
    for (std::size_t c = 0; c < s.contact.size(); ++c)
      if (is_reshaped(s.contact[c], s.options.contact[c]))
        reshaped_places.push_back(s.problem.nodes.positions[s.options.contact[c]]);
    // What a share loses goes to one beside it.
    const Nearness to_reshaped(reshaped_places);
    std::vector<std::size_t> reshaped_contact;
    for (std::size_t c = 0; c < s.contact.size(); ++c) {
      const int node = s.options.contact[c];
      if (to_reshaped(s.problem.nodes.positions[node]) < share_size * s.problem.nodes.spacings[node])
        reshaped_contact.push_back(c);
      else if (is_near(s.contact[c]))
        s.contact[c] = reweighed(s.contact[c], *s.spheres);
    }
    s.find_contact(reshaped_contact);
    for (const DisplacementMean& mean : s.contact)
      for (const int node : mean.nodes)
        if (s.slot[node] < 0)
          throw NumericalError("the cut came to the contact outside the window"); // condensed anew, below
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
      back->options.contact = previous_candidates;
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
