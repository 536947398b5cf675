#include "solvers/appended/appended_body.hpp"

#include "solvers/body/elastic_body.hpp"
#include "solvers/body/pieces.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <utility>

namespace spherecut::solvers {

namespace {

UncutOptions uncut_options(const Problem& problem, const DiscretisationOptions& options) {
  UncutOptions uncut;
  DiscretisationOptions with_cut = options;
  with_cut.cut_ahead = true;
  uncut.support_radius = galerkin_support_radius(problem, with_cut);
  uncut.estimate_condition = options.estimate_condition;
  return uncut;
}

CutSpaceOptions space_options(const DiscretisationOptions& options) {
  return options.tip_functions ? CutSpaceOptions{} : steps_alone();
}

BoundingBox everywhere(const Problem& problem) {
  BoundingBox box = problem.domain->bounds();
  const Vector3 margin = 0.01 * box.extent();
  return {box.lower - margin, box.upper + margin};
}

/// What of the sheets differs from one moment to the next.
BoundingBox changed_region(const topology::Incision* before, const topology::Incision& after, double margin) {
  BoundingBox region{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
  const auto include = [&](const topology::SurfaceMesh& sheet, std::size_t t) {
    for (const int vertex : sheet.triangles[t]) {
      region.lower = region.lower.cwiseMin(sheet.vertices[vertex]);
      region.upper = region.upper.cwiseMax(sheet.vertices[vertex]);
    }
  };
  const auto corners = [](const topology::SurfaceMesh& sheet, std::size_t t) {
    std::array<Vector3, 3> x;
    for (int k = 0; k < 3; ++k)
      x[k] = sheet.vertices[sheet.triangles[t][k]];
    return x;
  };
  const std::vector<topology::SurfaceMesh> none;
  const auto& old_sheets = before != nullptr ? before->sheets() : none;
  const auto& new_sheets = after.sheets();
  for (std::size_t s = 0; s < std::max(old_sheets.size(), new_sheets.size()); ++s) {
    const std::size_t was = s < old_sheets.size() ? old_sheets[s].triangles.size() : 0,
                      is = s < new_sheets.size() ? new_sheets[s].triangles.size() : 0;
    for (std::size_t t = 0; t < std::max(was, is); ++t) {
      if (t < was && t < is && corners(old_sheets[s], t) == corners(new_sheets[s], t))
        continue;
      if (t < was)
        include(old_sheets[s], t);
      if (t < is)
        include(new_sheets[s], t);
    }
  }
  return {region.lower.array() - margin, region.upper.array() + margin};
}

} // namespace

int base_nodes(const NodeCloud& nodes) {
  int base = 0;
  while (base < nodes.size() && nodes.kinds[base] != NodeKind::lip)
    ++base;
  for (int i = base; i < nodes.size(); ++i)
    if (nodes.kinds[i] != NodeKind::lip)
      throw InputError(
          fmt::format("node {} stands behind lip node {}: where a cut only appends, lip nodes come last", i, base));
  return base;
}

std::unique_ptr<Discretisation> make_appended(Problem problem, const DiscretisationOptions& options,
                                              std::shared_ptr<const UncutBody>& uncut) {
  require_domain(problem);
  require_one_material(problem, "a cut that appends");
  check_problem(problem);
  const int base = base_nodes(problem.nodes);
  const bool makes = uncut == nullptr || !uncut->fits(problem, base);
  if (makes)
    uncut = std::make_shared<const UncutBody>(problem, base, uncut_options(problem, options));
  auto body = std::make_unique<AppendedBody>(std::move(problem), options, uncut);
  if (!makes) // it was there: its factorisation took none of this body's time
    body->forget_factor_seconds();
  return body;
}

AppendedBody::AppendedBody(const Problem& problem, const DiscretisationOptions& options)
    : AppendedBody(
          problem, options,
          std::make_shared<const UncutBody>(problem, base_nodes(problem.nodes), uncut_options(problem, options))) {}

AppendedBody::AppendedBody(Problem problem, const DiscretisationOptions& options,
                           std::shared_ptr<const UncutBody> uncut)
    : problem_(std::move(problem)), options_(options), report_(uncut->report()), uncut_(std::move(uncut)) {
  check_problem(problem_);
  if (base_nodes(problem_.nodes) != uncut_->size())
    throw InputError(
        fmt::format("{} nodes with spheres on an uncut body of {}", base_nodes(problem_.nodes), uncut_->size()));
  space_ = std::make_unique<CutSpace>(uncut_->boxes(), *problem_.domain, uncut_->nodes(), uncut_->spheres(),
                                      problem_.material, space_options(options_));
  system_ = std::make_unique<CutSystem>(*uncut_, *space_);
  places_ = std::make_unique<KeptPlaces>(*uncut_, *space_, *system_);
  follow(everywhere(problem_));
}

AppendedBody::AppendedBody(const AppendedBody& other)
    : problem_(other.problem_), options_(other.options_), report_(other.report_), uncut_(other.uncut_),
      space_(std::make_unique<CutSpace>(*other.space_)), system_(std::make_unique<CutSystem>(*other.system_, *space_)),
      loose_(other.loose_), dropped_(other.dropped_), components_(other.components_), loads_(other.loads_),
      uncut_loads_(other.uncut_loads_), twin_loads_(other.twin_loads_),
      places_(std::make_unique<KeptPlaces>(*other.places_, *space_, *system_, problem_, dropped_places())) {}

KeptPlaces::IsDropped AppendedBody::dropped_places() const {
  if (dropped_.empty())
    return {};
  return [this](const Vector3& x) { return is_dropped(space_->cut().part_at(x, *problem_.incision)); };
}

// Functions and system follow problem_.incision, which differs from what they know in `region` alone.
void AppendedBody::follow(const BoundingBox& region) {
  const Stopwatch watch;
  CutSpace::Change change;
  if (problem_.incision != nullptr)
    change = space_->update(problem_.incision, region);
  find_pieces();
  system_->update(change, loose_);
  places_->follow(problem_, region, change, dropped_places());
  assemble_loads();
  report_.nodes = problem_.nodes.size();
  report_.unknowns = coefficient_count();
  report_.supports_seconds = 0;
  if (problem_.incision != nullptr)
    report_.assembly_seconds = watch.seconds();
}

std::unique_ptr<AppendedBody> AppendedBody::copy() const {
  return std::unique_ptr<AppendedBody>(new AppendedBody(*this));
}

std::string AppendedBody::grow(const SprinkleIncrement& change, Problem grown) {
  if (!change.removed.empty() || !uncut_->fits(grown, base_nodes(grown.nodes)))
    return "nodes have been exchanged";
  double largest = 0;
  for (const SmallBox& box : uncut_->boxes().boxes())
    largest = std::max(largest, box.half.norm());
  const BoundingBox region = changed_region(problem_.incision.get(), *grown.incision, 2 * largest);
  problem_ = std::move(grown);
  follow(region);
  forget_factor_seconds();
  return {};
}

void AppendedBody::find_pieces() {
  loose_.clear();
  dropped_.clear();
  report_.pieces.clear();
  if (problem_.incision == nullptr)
    return;
  components_ = space_->cut().components();
  std::vector<Piece> pieces(components_.count);
  std::vector<int> component_of(problem_.nodes.positions.size());
  for (int i = 0; i < problem_.nodes.size(); ++i) {
    const Vector3& x = problem_.nodes.positions[i];
    Piece& piece = pieces[component_of[i] = components_.of(space_->cut().part_at(x, *problem_.incision))];
    piece.nodes.push_back(i);
    piece.centroid += x;
  }
  for (const Prescribed& entry : problem_.prescribed)
    if (entry.components[0] || entry.components[1] || entry.components[2])
      pieces[component_of[entry.node]].held = true;
  for (const DisplacementMean& mean : uncut_->held())
    for (const QuadraturePoint& point : mean.share)
      pieces[components_.of(space_->cut().part_at(point.position, *problem_.incision))].held = true;
  std::vector<std::vector<int>> carriers(components_.count); // twins by the component that they reach into
  for (int k = 0; k < std::ssize(space_->functions()); ++k)
    if (const CutFunction& function = space_->functions()[k]; !function.is_front && !function.twin.is_step)
      carriers[components_.of(function.twin.hidden.front())].push_back(k);
  std::vector<char> dropped(components_.count, 0);
  for (int c = 0; c < components_.count; ++c) {
    Piece& piece = pieces[c];
    if (piece.nodes.empty())
      continue;
    piece.centroid /= static_cast<double>(piece.nodes.size());
    report_.pieces.push_back(piece);
    if (piece.held)
      continue;
    if (options_.unheld == UnheldPieces::refuse)
      continue;
    loose_.push_back(carriers[c]);
    if (options_.unheld == UnheldPieces::drop)
      dropped[c] = 1;
  }
  if (options_.unheld == UnheldPieces::refuse)
    require_held(report_.pieces);
  if (std::any_of(dropped.begin(), dropped.end(), [](char is) { return is != 0; }))
    dropped_ = std::move(dropped);
}

// ---- places

CutFunctional AppendedBody::value_at(const Vector3& x) const {
  return places_->mean_over({{x, 1}});
}

Vector3 AppendedBody::contact_point(int node) const {
  require_nodes({node});
  return places_->contact(node).centroid;
}

std::vector<Vector3> AppendedBody::constraint_points() const {
  std::vector<Vector3> points;
  std::size_t base = 0;
  for (const Prescribed& entry : problem_.prescribed)
    points.push_back(entry.node < uncut_->size() ? uncut_->held()[base++].centroid
                                                 : problem_.nodes.positions[entry.node]);
  return points;
}

double AppendedBody::sphere_radius(int node) const {
  require_nodes({node});
  return node < uncut_->size() ? uncut_->spheres().radii()[node] : 0;
}

void AppendedBody::shape_at(const Vector3& x, ShapeFunctions& shape) const {
  require_support(uncut_->spheres(), x, shape);
  shape.vectors.clear();
  if (space_->functions().empty())
    return;
  thread_local CutTerms terms;
  const PartId part = space_->cut().part_at(x, *problem_.incision);
  if (is_dropped(part)) { // nothing moves it
    for (auto* of : {&shape.value, &shape.dx, &shape.dy, &shape.dz})
      std::fill(of->begin(), of->end(), 0.0);
    return;
  }
  space_->take_out_faint(x, part, shape);
  space_->terms_at(x, part, shape, terms);
  for (const ScalarTerm& term : terms.scalar) {
    shape.nodes.push_back(uncut_->size() + term.function);
    shape.value.push_back(term.value);
    shape.dx.push_back(term.gradient.x());
    shape.dy.push_back(term.gradient.y());
    shape.dz.push_back(term.gradient.z());
  }
  for (const FrontTerm& term : terms.front)
    shape.vectors.push_back({uncut_->size() + term.function, term.value, term.gradient});
}

/// Base functions are linear in a box, as its products take them. A part that some function knows by its samples has a
/// point at each of them.
void AppendedBody::visit_weak_points(const BoundingBox& region, const std::function<bool(const Vector3& x)>& is_wanted,
                                     const PointVisitor& visit) const {
  const SmallBoxes& boxes = uncut_->boxes();
  std::vector<int> found;
  boxes.within(region, found);
  ShapeFunctions shape;
  std::map<std::pair<PartId, int>, std::vector<FrontTerm>> front; // of one cell
  int front_of = -1;
  for (const int box : found) {
    const int cell_index = boxes.cell_of(box), lane = boxes.lane_of(box);
    const BoxShapes& cell = boxes.cells()[cell_index];
    if (std::exchange(front_of, cell_index) != cell_index) {
      front.clear();
      space_->for_each_front_term(0, cell_index, [&](PartId part, int sample, const FrontTerm& term) {
        front[{part, sample}].push_back(term);
      });
    }
    for (int k = 0; k < space_->cut().part_count(box); ++k) {
      const PartId part = part_id(box, k);
      if (is_dropped(part))
        continue;
      const CutPart of_part = space_->cut().part(part);
      const double volume = of_part.share * boxes.boxes()[box].volume;
      const int samples = space_->known_samples(part);
      for (int n = 0; n < samples; ++n) {
        const PlacedSample* const sample = samples > 1 ? &space_->samples(part)[n] : nullptr;
        const Vector3& at = sample != nullptr ? sample->at : of_part.centroid;
        if (!region.contains(at) || !is_wanted(at))
          continue;
        shape_in_part(cell, part, lane, n, at, shape);
        if (const auto terms = front.find({part, n}); terms != front.end())
          for (const FrontTerm& term : terms->second)
            shape.vectors.push_back({uncut_->size() + term.function, term.value, term.gradient});
        visit({at, volume * (sample != nullptr ? sample->share : 1)}, shape);
      }
    }
  }
}

/// Functions of nodes, and twins and steps, at a sample of a part.
void AppendedBody::shape_in_part(const BoxShapes& cell, PartId part, int lane, int sample, const Vector3& x,
                                 ShapeFunctions& shape) const {
  for (auto* list : {&shape.value, &shape.dx, &shape.dy, &shape.dz})
    list->clear();
  shape.nodes.clear();
  shape.vectors.clear();
  const auto add = [&](int node, double value, const Vector3& gradient) {
    shape.nodes.push_back(node);
    shape.value.push_back(value);
    shape.dx.push_back(gradient.x());
    shape.dy.push_back(gradient.y());
    shape.dz.push_back(gradient.z());
  };
  const Vector3 off = x - uncut_->boxes().boxes()[box_of(part)].middle;
  for (std::size_t n = 0; n < cell.nodes.size(); ++n)
    if (const Vector3 gradient = cell.gradient_at(n, lane); cell.value_at(n, lane) != 0 || !gradient.isZero(0))
      add(cell.nodes[n], cell.value_at(n, lane) + gradient.dot(off), gradient);
  for (const int node : cell.nodes)
    for (const int k : space_->twins_of(node))
      if (ScalarTerm term; space_->term_at(k, part, sample, term))
        add(uncut_->size() + k, term.value, term.gradient);
}

PointState AppendedBody::at(const Vector3& x, const Field& field) const {
  require_own(field);
  thread_local ShapeFunctions shape;
  shape_at(x, shape);
  return state_from(problem_, problem_.material, shape, field);
}

VectorX AppendedBody::nodal_displacements(const Field& field) const {
  require_own(field);
  const CutVectors parts = split(field.coefficients);
  VectorX displacements(3 * static_cast<Eigen::Index>(problem_.nodes.size()));
  for (int i = 0; i < problem_.nodes.size(); ++i)
    displacements.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        CutSystem::value(places_->at_node(i), parts.base, parts.cut);
  return displacements;
}

MatrixX AppendedBody::contact_displacements(const std::vector<int>& nodes, const std::vector<Field>& fields) const {
  require_nodes(nodes);
  require_own(fields);
  places_->require(nodes);
  MatrixX displacements(3 * std::ssize(nodes), std::ssize(fields));
  for (Eigen::Index f = 0; f < std::ssize(fields); ++f) {
    const CutVectors parts = split(fields[f].coefficients);
    for (Eigen::Index c = 0; c < std::ssize(nodes); ++c)
      displacements.col(f).segment<3>(3 * c) = CutSystem::value(places_->contact(nodes[c]).mean, parts.base, parts.cut);
  }
  return displacements;
}

// ---- solutions

CutVectors AppendedBody::split(const VectorX& coefficients) const {
  const Eigen::Index base = 3 * static_cast<Eigen::Index>(uncut_->size());
  return {coefficients.head(base), coefficients.tail(coefficients.size() - base), {}};
}

VectorX AppendedBody::base_prescribed(const VectorX& prescribed) const {
  VectorX result(3 * std::ssize(uncut_->held()));
  Eigen::Index base = 0;
  for (Eigen::Index k = 0; k < std::ssize(problem_.prescribed); ++k)
    if (problem_.prescribed[k].node < uncut_->size())
      result.segment<3>(3 * base++) = prescribed.segment<3>(3 * k);
  return result;
}

Field AppendedBody::solved(const CutVectors& loads, const VectorX& prescribed,
                           const std::function<Vector3(const Vector3&)>& field, double load_factor) const {
  const VectorX held = base_prescribed(prescribed);
  const Eigen::Index base = 3 * static_cast<Eigen::Index>(uncut_->size());
  VectorX coefficients = VectorX::Zero(coefficient_count());
  const auto rest = [&] { // what is not in balance yet
    CutVectors rows = system_->elastic_forces(coefficients.head(base), coefficients.tail(coefficients.size() - base));
    system_->subtract_holding(coefficients.head(base), coefficients.tail(coefficients.size() - base), held, field,
                              rows);
    return CutVectors{loads.base - rows.base, loads.cut - rows.cut, loads.multipliers};
  };
  // A second solution takes back what the large penalties have rounded off.
  for (int round = 0; round < 2; ++round) {
    CutVectors right = rest();
    if (right.base.isZero(0) && right.cut.isZero(0))
      break;
    right.multipliers.setZero();
    const CutVectors correction = system_->solve(right);
    coefficients.head(base) += correction.base;
    coefficients.tail(coefficients.size() - base) += correction.cut;
  }
  Field result{coefficients, {}, load_factor, prescribed};
  require_finite(result, report_);
  return result;
}

Field AppendedBody::solve() const {
  VectorX prescribed = prescribed_values(problem_);
  if (problem_.prescribed_field) {
    Eigen::Index base = 0;
    for (Eigen::Index k = 0; k < std::ssize(problem_.prescribed); ++k)
      if (problem_.prescribed[k].node < uncut_->size())
        prescribed.segment<3>(3 * k) = uncut_->held()[base++].of(problem_.prescribed_field);
  }
  return solved(loads_, prescribed, problem_.prescribed_field, 1);
}

Field AppendedBody::prescribed_response(const std::vector<Vector3>& values) const {
  return solved(system_->zero(1), prescribed_values(problem_, values), {}, 0);
}

double AppendedBody::load_work(const Field& field) const {
  require_own(field);
  const CutVectors parts = split(field.coefficients);
  return field.load_factor * (loads_.base.col(0).dot(parts.base.col(0)) + loads_.cut.col(0).dot(parts.cut.col(0)));
}

std::vector<Field> AppendedBody::fields_of(const CutVectors& solutions) const {
  std::vector<Field> fields;
  fields.reserve(solutions.base.cols());
  for (Eigen::Index k = 0; k < solutions.base.cols(); ++k) {
    VectorX coefficients(coefficient_count());
    coefficients << solutions.base.col(k), solutions.cut.col(k);
    fields.push_back({std::move(coefficients), {}, 0, VectorX::Zero(3 * std::ssize(problem_.prescribed))});
    require_finite(fields.back(), report_);
  }
  return fields;
}

CutVectors AppendedBody::unit_forces(const std::vector<int>& nodes) const {
  places_->require(nodes);
  CutVectors loads = system_->zero(3 * std::ssize(nodes));
  for (Eigen::Index c = 0; c < std::ssize(nodes); ++c)
    for (int axis = 0; axis < 3; ++axis)
      CutSystem::add_force(places_->contact(nodes[c]).mean, Vector3::Unit(axis), 3 * c + axis, loads);
  return loads;
}

CutVectors AppendedBody::case_forces(const std::vector<int>& nodes, const MatrixX& forces) const {
  require_cases(nodes, forces);
  places_->require(nodes);
  CutVectors loads = system_->zero(forces.cols());
  for (Eigen::Index c = 0; c < std::ssize(nodes); ++c)
    for (Eigen::Index k = 0; k < forces.cols(); ++k)
      if (const Vector3 force = forces.col(k).segment<3>(3 * c); !force.isZero(0))
        CutSystem::add_force(places_->contact(nodes[c]).mean, force, k, loads);
  return loads;
}

std::vector<Field> AppendedBody::force_responses(const std::vector<int>& candidates) const {
  require_nodes(candidates);
  return fields_of(system_->solve(unit_forces(candidates)));
}

std::vector<Field> AppendedBody::case_responses(const std::vector<int>& nodes, const MatrixX& forces) const {
  return fields_of(system_->solve(case_forces(nodes, forces)));
}

CaseResponses AppendedBody::condense_cases(const std::vector<int>& nodes, const MatrixX& forces,
                                           const std::vector<int>& at) const {
  require_nodes(at);
  const CutVectors cases = system_->half_solutions(case_forces(nodes, forces));
  CaseResponses responses;
  responses.among = CutSystem::compliance(cases, cases);
  responses.at = CutSystem::compliance(places_->unit_halves(at), cases);
  return responses;
}

MatrixX AppendedBody::contact_compliance(const std::vector<int>& candidates) const {
  require_nodes(candidates);
  return places_->compliance(candidates);
}

MatrixX AppendedBody::compliance_between(const std::vector<int>& at, const std::vector<int>& forced) const {
  require_nodes(at);
  require_nodes(forced);
  return CutSystem::compliance(places_->unit_halves(at), places_->unit_halves(forced));
}

std::vector<Field> AppendedBody::pattern_responses(const std::vector<ForcePattern>& patterns) const {
  CutVectors loads = system_->zero(std::ssize(patterns));
  for (Eigen::Index p = 0; p < std::ssize(patterns); ++p)
    for (std::size_t k = 0; k < patterns[p].points.size(); ++k)
      CutSystem::add_force(value_at(patterns[p].points[k]), patterns[p].forces[k], p, loads);
  return fields_of(system_->solve(loads));
}

MatrixX AppendedBody::pattern_displacements(const std::vector<ForcePattern>& patterns,
                                            const std::vector<Field>& fields) const {
  require_own(fields);
  MatrixX displacements = MatrixX::Zero(std::ssize(patterns), std::ssize(fields));
  for (Eigen::Index p = 0; p < std::ssize(patterns); ++p)
    for (std::size_t k = 0; k < patterns[p].points.size(); ++k) {
      const CutFunctional value = value_at(patterns[p].points[k]);
      for (Eigen::Index f = 0; f < std::ssize(fields); ++f) {
        const CutVectors parts = split(fields[f].coefficients);
        displacements(p, f) += patterns[p].forces[k].dot(CutSystem::value(value, parts.base, parts.cut));
      }
    }
  return displacements;
}

std::vector<Vector3> AppendedBody::constraint_forces(const Field& field) const {
  require_own(field);
  const CutVectors parts = split(field.coefficients);
  std::vector<Vector3> forces;
  std::size_t base = 0;
  for (Eigen::Index k = 0; k < std::ssize(problem_.prescribed); ++k) {
    const Prescribed& entry = problem_.prescribed[k];
    if (entry.node >= uncut_->size()) { // its part of the surface belongs to the others
      forces.emplace_back(Vector3::Zero());
      continue;
    }
    const Vector3 gap =
        field.prescribed.segment<3>(3 * k) - CutSystem::value(system_->held()[base++], parts.base, parts.cut);
    forces.emplace_back(constraint_stiffness(problem_, entry.node) * held_part(entry, gap));
  }
  return forces;
}

double AppendedBody::residual(const Field& field, const std::vector<int>& loaded_nodes,
                              const std::vector<Vector3>& nodal_forces) const {
  require_loads(loaded_nodes, nodal_forces);
  require_own(field);
  const CutVectors parts = split(field.coefficients);
  CutVectors applied = loads_;
  applied.base *= field.load_factor;
  applied.cut *= field.load_factor;
  for (std::size_t k = 0; k < loaded_nodes.size(); ++k)
    CutSystem::add_force(places_->contact(loaded_nodes[k]).mean, nodal_forces[k], 0, applied);
  CutVectors rows = system_->elastic_forces(parts.base, parts.cut);
  system_->subtract_holding(parts.base, parts.cut, base_prescribed(field.prescribed),
                            field.load_factor != 0 ? problem_.prescribed_field : nullptr, rows);
  const double unbalanced =
      std::max((rows.base - applied.base).lpNorm<Eigen::Infinity>(),
               (rows.cut - applied.cut).size() > 0 ? (rows.cut - applied.cut).lpNorm<Eigen::Infinity>() : 0);
  double largest = applied.base.lpNorm<Eigen::Infinity>();
  for (const Vector3& force : constraint_forces(field))
    largest = std::max(largest, force.lpNorm<Eigen::Infinity>());
  return largest > 0 ? unbalanced / largest : 0;
}

Vector3 AppendedBody::front_intensities(const Field& field, const topology::FrontFrame& front) const {
  require_own(field);
  ShapeFunctions shape;
  require_support(uncut_->spheres(), front.point, shape);
  Vector3 intensities = Vector3::Zero();
  double weight = 0;
  for (std::size_t k = 0; k < space_->functions().size(); ++k) {
    const CutFunction& function = space_->functions()[k];
    if (!function.is_front)
      continue;
    double value = 0;
    for (int n = 0; n < shape.size(); ++n) {
      const auto at = std::lower_bound(function.group.nodes.begin(), function.group.nodes.end(), shape.nodes[n]);
      if (at != function.group.nodes.end() && *at == shape.nodes[n])
        value += shape.value[n] * function.group.weights[at - function.group.nodes.begin()];
    }
    if (value == 0)
      continue;
    weight += value;
    intensities += value * front_intensity(problem_.material, function.group.station) *
                   field.coefficients.segment<3>(3 * static_cast<Eigen::Index>(uncut_->size() + k));
  }
  if (weight == 0)
    throw InputError(fmt::format("no front function reaches the place ({:.4g}, {:.4g}, {:.4g}) m of the front",
                                 front.point.x(), front.point.y(), front.point.z()));
  return intensities;
}

} // namespace spherecut::solvers
