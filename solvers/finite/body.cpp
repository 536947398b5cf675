#include "solvers/finite/body.hpp"

#include "solvers/algebra/parallel.hpp"
#include "solvers/appended/appended_body.hpp"
#include "solvers/elasticity/function_law.hpp"
#include "solvers/elasticity/prestrained_law.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "solvers/finite/held_shares.hpp"
#include "solvers/finite/tangent.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "solvers/points/point_kernels.hpp"
#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace spherecut::solvers {

namespace {

constexpr int groups_of_a_sum = 32; // groups that are worked on together: sums are taken chunk by chunk
constexpr double least_mapped_jacobian = 0.05;

Problem with_law(Problem problem, const Law* law, const FiniteOptions& options) {
  if (law == nullptr)
    throw InputError("a body at finite strain needs a law");
  require_one_material(problem, "a law of finite strain");
  const ElasticConstants moduli = law->small_strain();
  problem.material.young_modulus = moduli.young_modulus();
  problem.material.poisson_ratio = moduli.poisson_ratio();
  check_problem(problem);
  require_domain(problem);
  if (!(options.support_radius >= 1 && options.support_radius <= 4))
    throw InputError(fmt::format("support radius of {} spacings; allowed: 1 to 4", options.support_radius));
  if (!(options.pointwise_modulus >= 0))
    throw InputError(fmt::format("pointwise modulus of {} mu; it must not be negative", options.pointwise_modulus));
  check_prony_terms(options.prony);
  if (options.sight == SightRule::appended)
    for (const Prescribed& entry : problem.prescribed)
      if (entry.node >= base_nodes(problem.nodes))
        throw InputError(fmt::format("node {} is held; where a cut appends, lip nodes have no unknowns: nodes 0 to {} "
                                     "can be",
                                     entry.node, base_nodes(problem.nodes) - 1));
  return problem;
}

/// The functions of the rule `appended`, on the uncut body that is there where it fits; null by the other rules.
std::unique_ptr<const CutFunctions> cut_functions_of(const Problem& problem, const FiniteOptions& options,
                                                     std::shared_ptr<const UncutFunctions> uncut) {
  if (options.sight != SightRule::appended)
    return nullptr;
  const int base = base_nodes(problem.nodes);
  if (uncut == nullptr || !uncut->fits(problem, base, options.support_radius, options.consistent))
    uncut = std::make_shared<const UncutFunctions>(problem, base, options.support_radius, options.consistent);
  return std::make_unique<const CutFunctions>(std::move(uncut), problem);
}

std::shared_ptr<const Law> with_prestrain(std::shared_ptr<const Law> law, const Matrix3& elastic) {
  return elastic == Matrix3::Identity() ? std::move(law) : prestrained(std::move(law), elastic);
}

/// The cofactor matrix J F^-T, column-major, and J.
double cofactor_of(const double* f, double* c) {
  c[0] = f[4] * f[8] - f[7] * f[5];
  c[3] = f[7] * f[2] - f[1] * f[8];
  c[6] = f[1] * f[5] - f[4] * f[2];
  c[1] = f[6] * f[5] - f[3] * f[8];
  c[4] = f[0] * f[8] - f[6] * f[2];
  c[7] = f[3] * f[2] - f[0] * f[5];
  c[2] = f[3] * f[7] - f[6] * f[4];
  c[5] = f[6] * f[1] - f[0] * f[7];
  c[8] = f[0] * f[4] - f[3] * f[1];
  return f[0] * c[0] + f[3] * c[3] + f[6] * c[6];
}

} // namespace

struct FiniteBody::Work {
  std::vector<LaneValues> deformation; // [group][9]
  std::vector<double> swollen;         // [group], m3: sum of w J
  std::vector<double> jacobian;        // [block]
  std::vector<double> slots;           // [slot][3], N: with several threads
  std::vector<int> incident_start, incident;
  std::vector<double> chunk_energy, chunk_least;
};

FiniteBody::~FiniteBody() = default;

FiniteBody::FiniteBody(Problem problem, std::shared_ptr<const Law> law, const FiniteOptions& options,
                       const std::function<FibreFrame(const Vector3& x)>& fibres,
                       const std::shared_ptr<const UncutFunctions>& uncut)
    : problem_(with_law(std::move(problem), law.get(), options)),
      prestrain_(Matrix3::Identity() - problem_.loads.initial_strain), law_(with_prestrain(std::move(law), prestrain_)),
      options_(options), fibre_field_(fibres), cut_functions_(cut_functions_of(problem_, options, uncut)),
      work_(std::make_unique<Work>()) {
  if (cut_functions_ == nullptr)
    own_spheres_ = std::make_unique<const Spheres>(problem_.nodes.positions, problem_.nodes.spacings,
                                                   options.support_radius, Basis::linear, worst_moment_condition,
                                                   sight_about_cut(problem_, Method::galerkin, options.sight));
  functions_ = cut_functions_ != nullptr ? cut_functions_->size() : size();
  patches_ = std::make_unique<SurfacePatches>(*problem_.domain, problem_.nodes, problem_.incision);
  hold();
  tabulate();
  assemble_loads();
  if (cut_functions_ == nullptr)
    supports_ = nodal_supports(*own_spheres_);
  if (!options_.prony.empty()) {
    std::vector<Vector3> places;
    for (int group = 0; group < table_.groups(); ++group)
      for (int lane = 0; lane < table_.count[group]; ++lane)
        places.push_back(table_.positions[static_cast<std::size_t>(point_lanes) * group + lane]);
    prony_ = std::make_unique<PronyState>(options_.prony, places.size(), law_->small_strain_only());
    places_ = std::make_unique<topology::PointTree>(places);
  }
}

// Its pattern and order of elimination take long, and a body may do without.
const FiniteTangent& FiniteBody::assembler() const {
  if (tangent_ == nullptr)
    tangent_ = std::make_unique<FiniteTangent>(*this);
  return *tangent_;
}

const Spheres& FiniteBody::spheres() const {
  return own_spheres_ != nullptr ? *own_spheres_ : cut_functions_->uncut()->spheres();
}

int FiniteBody::node_of(int function) const {
  return cut_functions_ != nullptr ? cut_functions_->node_of(function) : function;
}

bool FiniteBody::evaluate(const Vector3& x, ShapeFunctions& shape) const {
  return cut_functions_ != nullptr ? cut_functions_->evaluate(x, shape) : solvers::evaluate(*own_spheres_, x, shape);
}

void FiniteBody::shape_at(const Vector3& x, ShapeFunctions& shape) const {
  if (cut_functions_ == nullptr)
    require_support(*own_spheres_, x, shape);
  else if (!cut_functions_->evaluate(x, shape))
    require_support(spheres(), x, shape);
}

/// The mean over the same share, or of the same place, by the functions on the cut.
DisplacementMean FiniteBody::weighed(DisplacementMean mean) const {
  if (cut_functions_ == nullptr)
    return mean;
  std::map<int, double> weights;
  ShapeFunctions shape;
  for (const QuadraturePoint& point : mean.share) {
    shape_at(point.position, shape);
    for (int k = 0; k < shape.size(); ++k)
      weights[shape.nodes[k]] += point.weight * shape.value[k];
  }
  mean.nodes.clear();
  mean.weights.clear();
  for (const auto& [function, weight] : weights)
    if (weight != 0) {
      mean.nodes.push_back(function);
      mean.weights.push_back(weight);
    }
  return mean;
}

// A cut parts shares of the uncut body: each part is held for itself, by the function that its node has there.
void FiniteBody::hold() {
  std::vector<int> own;
  own.reserve(problem_.prescribed.size());
  for (const Prescribed& entry : problem_.prescribed)
    own.push_back(entry.node);
  if (cut_functions_ == nullptr) {
    held_ =
        std::make_unique<HeldMeans>(problem_.prescribed, held_shares(problem_, spheres(), *patches_), own, functions_);
    return;
  }
  Problem uncut = problem_;
  uncut.incision = nullptr;
  uncut.nodes = cut_functions_->uncut()->nodes();
  const std::vector<DisplacementMean> whole = held_shares(uncut, spheres(), cut_functions_->uncut()->patches());
  const int base = uncut.nodes.size();
  std::vector<Prescribed> entries;
  std::vector<DisplacementMean> means;
  std::vector<int> followers;
  ShapeFunctions shape;
  for (std::size_t e = 0; e < whole.size(); ++e) {
    std::map<int, DisplacementMean> parts; // by function of the node
    for (const QuadraturePoint& point : whole[e].share) {
      shape_at(point.position, shape);
      int side = own[e];
      for (const int function : shape.nodes)
        if (function >= base && node_of(function) == own[e] && !cut_functions_->twin(function - base).is_step)
          side = function;
      parts[side].share.push_back(point);
    }
    for (auto& [function, part] : parts) {
      double share = 0;
      for (const QuadraturePoint& point : part.share) {
        share += point.weight;
        part.centroid += point.weight * point.position;
      }
      part.centroid /= share;
      part.area = share * whole[e].area;
      for (QuadraturePoint& point : part.share)
        point.weight /= share;
      entries.push_back(problem_.prescribed[e]);
      means.push_back(weighed(std::move(part)));
      followers.push_back(function);
    }
  }
  held_ = std::make_unique<HeldMeans>(std::move(entries), std::move(means), followers, functions_);
}

int FiniteBody::carrier_of(const DisplacementMean& mean) {
  const auto largest = std::max_element(mean.weights.begin(), mean.weights.end());
  return mean.nodes[largest - mean.weights.begin()];
}

void FiniteBody::tabulate() {
  BackgroundCells cells;
  if (cut_functions_ != nullptr) {
    table_ = cut_functions_->tabulate(cells);
    std::vector<int> group_of(cells.start.size(), -1); // by cell of the table
    for (int uncut = 0; uncut < std::ssize(cells.boxes); ++uncut)
      for (int cell = cells.boxes[uncut].first_cell; cell < cells.boxes[uncut].last_cell; ++cell)
        group_of[cell] = uncut;
    uncut_groups_.reserve(table_.cell.size());
    for (const int cell : table_.cell)
      uncut_groups_.push_back(group_of[cell]);
    consistency_ = cut_functions_->uncut()->consistency();
  } else {
    cells = background_cells(*problem_.domain, problem_.nodes,
                             {options_.cell_size, options_.quadrature, options_.sight == SightRule::enriched},
                             problem_.incision.get());
    table_ = tabulate_points(cells, *own_spheres_);
  }
  const ElasticConstants moduli = law_->small_strain();
  if (minds_volume())
    share_ = std::min(1.0, options_.pointwise_modulus * moduli.shear_modulus / moduli.bulk_modulus);
  if (share_ < 1)
    blocks_ = dilatation_blocks(*problem_.domain, cells, table_, problem_.incision.get());
  if (options_.consistent && cut_functions_ == nullptr)
    consistency_ =
        make_consistent(problem_.nodes.positions, surface_integrals(*own_spheres_, patches_->points()), table_);
  for (int group = 0; group < table_.groups(); ++group) {
    point_start_.push_back(group == 0 ? 0 : point_start_.back() + table_.count[group - 1]);
    for (int lane = 0; lane < table_.count[group]; ++lane) {
      volume_ += table_.weights[group].value[lane];
      if (fibre_field_)
        fibres_.push_back(fibre_field_(table_.positions[static_cast<std::size_t>(point_lanes) * group + lane]));
    }
  }
  const auto groups = static_cast<std::size_t>(table_.groups());
  work_->deformation.resize(9 * groups);
  work_->swollen.resize(groups);
  work_->jacobian.assign(blocks_.volume.size(), 1);
  const std::size_t chunks = (groups + groups_of_a_sum - 1) / groups_of_a_sum;
  work_->chunk_energy.resize(chunks);
  work_->chunk_least.resize(chunks);
  work_->incident_start.assign(static_cast<std::size_t>(functions_) + 1, 0);
  for (const int node : table_.nodes)
    ++work_->incident_start[node + 1];
  for (int i = 0; i < functions_; ++i)
    work_->incident_start[i + 1] += work_->incident_start[i];
  work_->incident.resize(table_.nodes.size());
  std::vector<int> next(work_->incident_start.begin(), work_->incident_start.end() - 1);
  for (int slot = 0; slot < std::ssize(table_.nodes); ++slot)
    work_->incident[next[table_.nodes[slot]]++] = slot;
}

// Tractions are integrated at the points of the shares: so a constant stress is in balance with its own traction, and
// with the forces of held means.
void FiniteBody::assemble_loads() {
  loads_ = VectorX::Zero(3 * static_cast<Eigen::Index>(functions_));
  ShapeFunctions shape;
  const auto add = [&](const Vector3& x, const Vector3& force) {
    if (force.isZero(0))
      return;
    if (!force.allFinite())
      throw InputError(fmt::format("the load at ({:.6g}, {:.6g}, {:.6g}) m is not finite", x.x(), x.y(), x.z()));
    if (!evaluate(x, shape))
      throw NumericalError(
          fmt::format("no sound support covers the loaded point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
    for (int k = 0; k < shape.size(); ++k)
      loads_.segment<3>(3 * shape.nodes[k]) += shape.value[k] * force;
  };
  const Loads& loads = problem_.loads;
  if (loads.body_force)
    for (int group = 0; group < table_.groups(); ++group)
      for (int lane = 0; lane < table_.count[group]; ++lane) {
        const Vector3& x = table_.positions[static_cast<std::size_t>(point_lanes) * group + lane];
        add(x, table_.weights[group].value[lane] * loads.body_force(x));
      }
  const std::span<const SurfacePoint> all = patches_->points();
  const std::size_t skin = patches_->skin_points();
  if (loads.traction)
    for (const SurfacePoint& point : all.first(skin))
      add(point.position, point.weight * loads.traction(point.position, point.normal));
  if (loads.lip_traction)
    for (const SurfacePoint& point : all.subspan(skin))
      add(point.position, point.weight * loads.lip_traction(point.position, point.normal));
}

std::vector<Vector3> FiniteBody::prescribed_values() const {
  if (problem_.prescribed_field)
    return prescribed_values(problem_.prescribed_field);
  std::vector<Vector3> values;
  for (const Prescribed& entry : held_->entries())
    values.push_back(entry.value);
  return values;
}

std::vector<Vector3> FiniteBody::prescribed_values(const std::function<Vector3(const Vector3& x)>& field) const {
  std::vector<Vector3> values;
  for (const DisplacementMean& mean : held_->means())
    values.push_back(mean.of(field));
  return values;
}

DisplacementMean FiniteBody::contact_mean(int node) const {
  if (node < 0 || node >= size() || problem_.nodes.kinds[node] == NodeKind::interior)
    throw InputError(fmt::format("node {} of {} is not on the surface: a tool cannot touch it", node, size()));
  return weighed(patches_->contact_mean(node, spheres(), problem_));
}

double FiniteBody::deform(const VectorX& coefficients) const {
  if (coefficients.size() != 3 * static_cast<Eigen::Index>(functions_))
    throw InputError(
        fmt::format("{} coefficients for {} functions; there are 3 of each", coefficients.size(), functions_));
  Work& work = *work_;
  parallel_ranges(table_.groups(), groups_of_a_sum, [&](int begin, int end) {
    double least = std::numeric_limits<double>::infinity();
    for (int group = begin; group < end; ++group) {
      const std::span<const int> nodes = table_.nodes_of(group);
      LaneValues* f = work.deformation.data() + 9 * static_cast<std::size_t>(group);
      deformation_gradients(nodes.data(), static_cast<int>(nodes.size()), table_.gradients_of(group),
                            coefficients.data(), f);
      double swollen = 0;
      for (int lane = 0; lane < table_.count[group]; ++lane) {
        const auto at = [&](int k) { return f[k].value[lane]; };
        const double j = at(0) * (at(4) * at(8) - at(7) * at(5)) - at(3) * (at(1) * at(8) - at(7) * at(2)) +
                         at(6) * (at(1) * at(5) - at(4) * at(2));
        swollen += table_.weights[group].value[lane] * j;
        least = std::min(least, std::isnan(j) ? -std::numeric_limits<double>::infinity() : j);
      }
      work.swollen[group] = swollen;
    }
    work.chunk_least[begin / groups_of_a_sum] = least;
  });
  std::fill(work.jacobian.begin(), work.jacobian.end(), 0.0);
  if (blocks_.size() > 0) {
    for (int group = 0; group < table_.groups(); ++group)
      work.jacobian[blocks_.block[group]] += work.swollen[group];
    for (int b = 0; b < blocks_.size(); ++b)
      work.jacobian[b] /= blocks_.volume[b];
  }
  return *std::min_element(work.chunk_least.begin(), work.chunk_least.end());
}

// Of a point that weighs something, counted from the first one of a group on.
const Vector3& FiniteBody::place_of(int group, std::size_t point) const {
  for (; point >= static_cast<std::size_t>(table_.count[group]); ++group)
    point -= table_.count[group];
  return table_.positions[static_cast<std::size_t>(point_lanes) * group + point];
}

// Energy, J, and forces of consecutive groups; the forces are added, or left in the slots for several threads.
double FiniteBody::add_chunk(int begin, int end, const std::vector<double>& pressure, bool one_thread,
                             VectorX& forces) const {
  const double own = pointwise_share();
  const bool minds = minds_volume();
  constexpr int most = groups_of_a_sum * point_lanes;
  std::array<Matrix3, most> gradient, stress;
  std::array<double, most> density;
  const int count = count_from(begin, end);
  gradients_of(begin, end, gradient.data());
  const auto gradients = std::span<const Matrix3>(gradient).first(count);
  const auto densities = std::span(density).first(count);
  const auto stresses = std::span(stress).first(count);
  try {
    law_->evaluate_isochoric(gradients, fibres_of(begin, count), densities, stresses);
  } catch (const LawValueError& error) {
    throw_with_place(error, place_of(begin, error.point()));
  }
  if (prony_ != nullptr)
    prony_->apply(static_cast<std::size_t>(point_start_[begin]), gradients, densities, stresses);
  double sum = 0;
  int point = 0;
  std::vector<double> local;
  for (int group = begin; group < end; ++group) {
    LaneValues weighted[9];
    const double of_block = blocks_.size() > 0 ? pressure[blocks_.block[group]] : 0;
    for (int lane = 0; lane < table_.count[group]; ++lane, ++point) {
      const double weight = table_.weights[group].value[lane];
      double c[9], p = 0;
      if (minds) {
        const double j = cofactor_of(gradient[point].data(), c);
        p = own * law_->pressure(j) + of_block;
        density[point] += own * law_->volumetric_energy(j);
      } else {
        std::fill_n(c, 9, 0.0);
      }
      sum += weight * density[point];
      for (int k = 0; k < 9; ++k)
        weighted[k].value[lane] = weight * (stress[point].data()[k] + p * c[k]);
    }
    const std::span<const int> nodes = table_.nodes_of(group);
    const int here = static_cast<int>(nodes.size());
    if (one_thread) {
      local.resize(3 * nodes.size());
      group_forces(here, table_.gradients_of(group), weighted, local.data());
      for (int k = 0; k < here; ++k)
        for (int axis = 0; axis < 3; ++axis)
          forces[3 * nodes[k] + axis] += local[3 * k + axis];
    } else {
      group_forces(here, table_.gradients_of(group), weighted,
                   work_->slots.data() + 3 * static_cast<std::size_t>(table_.start[group]));
    }
  }
  return sum;
}

void FiniteBody::evaluate(const VectorX& coefficients, FiniteForces& out) const {
  Work& work = *work_;
  out.least_jacobian = deform(coefficients);
  if (minds_volume() && !(out.least_jacobian > 0)) {
    out.energy = std::numeric_limits<double>::infinity();
    return;
  }
  const double shared = 1 - pointwise_share();
  std::vector<double> pressure(work.jacobian.size());
  double energy = 0;
  for (int b = 0; b < blocks_.size(); ++b) {
    pressure[b] = shared * law_->pressure(work.jacobian[b]);
    energy += shared * blocks_.volume[b] * law_->volumetric_energy(work.jacobian[b]);
  }
  out.forces.setZero(3 * static_cast<Eigen::Index>(functions_));
  const bool one_thread = thread_count() == 1;
  if (!one_thread)
    work.slots.resize(3 * table_.nodes.size());
  parallel_ranges(table_.groups(), groups_of_a_sum, [&](int begin, int end) {
    work.chunk_energy[begin / groups_of_a_sum] = add_chunk(begin, end, pressure, one_thread, out.forces);
  });
  if (!one_thread)
    parallel_ranges(functions_, 64, [&](int begin, int end) {
      for (int i = begin; i < end; ++i)
        for (int k = work.incident_start[i]; k < work.incident_start[i + 1]; ++k)
          for (int axis = 0; axis < 3; ++axis)
            out.forces[3 * i + axis] += work.slots[3 * static_cast<std::size_t>(work.incident[k]) + axis];
    });
  for (const double part : work.chunk_energy)
    energy += part;
  out.energy = energy;
}

VectorX FiniteBody::stress_free() const {
  VectorX coefficients(3 * static_cast<Eigen::Index>(functions_));
  const Matrix3 gradient = prestrain_.inverse() - Matrix3::Identity();
  for (int i = 0; i < functions_; ++i)
    coefficients.segment<3>(3 * static_cast<Eigen::Index>(i)) = gradient * problem_.nodes.positions[node_of(i)];
  return coefficients;
}

int FiniteBody::count_from(int begin, int end) const {
  int count = 0;
  for (int group = begin; group < end; ++group)
    count += table_.count[group];
  return count;
}

void FiniteBody::gradients_of(int begin, int end, Matrix3* gradients) const {
  for (int group = begin; group < end; ++group) {
    const LaneValues* f = work_->deformation.data() + 9 * static_cast<std::size_t>(group);
    for (int lane = 0; lane < table_.count[group]; ++lane, ++gradients)
      for (int k = 0; k < 9; ++k)
        gradients->data()[k] = f[k].value[lane];
  }
}

std::span<const FibreFrame> FiniteBody::fibres_of(int begin, int count) const {
  return fibres_.empty() ? std::span<const FibreFrame>() : std::span(fibres_).subspan(point_start_[begin], count);
}

void FiniteBody::begin_step(double seconds) {
  if (prony_ != nullptr)
    prony_->begin(seconds);
}

void FiniteBody::accept_step(const VectorX& coefficients) {
  if (prony_ == nullptr)
    return;
  deform(coefficients);
  const std::size_t points = prony_->points();
  std::vector<Matrix3> gradients(points), stresses(points);
  std::vector<double> densities(points);
  gradients_of(0, table_.groups(), gradients.data());
  law_->evaluate_isochoric(gradients, fibres_of(0, static_cast<int>(points)), densities, stresses);
  prony_->accept(gradients, stresses);
}

void FiniteBody::tangent(const VectorX& coefficients, double penalty, SparseMatrix& lower) const {
  deform(coefficients);
  assembler().assemble(work_->deformation, work_->jacobian, penalty, lower);
}

std::optional<UniformTangent> FiniteBody::uniform_tangent(const VectorX& coefficients) const {
  deform(coefficients);
  return uniform_tangent_of(*this, work_->deformation, work_->jacobian);
}

const std::vector<int>& FiniteBody::rank() const {
  return assembler().rank();
}

double FiniteBody::penalty_stiffness(int entry, double penalty) const {
  return penalty * law_->small_strain().shear_modulus * problem_.nodes.spacings[held_->entries()[entry].node];
}

double FiniteBody::support_of(int function) const {
  constexpr double little = 1e-7; // of mu times the spacing
  return little * law_->small_strain().shear_modulus * problem_.nodes.spacings[node_of(function)];
}

std::vector<Matrix3> FiniteBody::piola_maps(const VectorX& coefficients) const {
  deform(coefficients);
  std::vector<Matrix3> maps(functions_, Matrix3::Zero());
  std::vector<double> shares(functions_, 0);
  for (int group = 0; group < table_.groups(); ++group) {
    const LaneValues* f = work_->deformation.data() + 9 * static_cast<std::size_t>(group);
    Matrix3 mean;
    for (int k = 0; k < 9; ++k) {
      double sum = 0;
      for (int lane = 0; lane < table_.count[group]; ++lane)
        sum += f[k].value[lane];
      mean.data()[k] = sum / table_.count[group];
    }
    for (int slot = table_.start[group]; slot < table_.start[group + 1]; ++slot) {
      maps[table_.nodes[slot]] += table_.shares[slot] * mean;
      shares[table_.nodes[slot]] += table_.shares[slot];
    }
  }
  for (int i = 0; i < functions_; ++i) {
    if (shares[i] > 0)
      maps[i] /= shares[i];
    const double jacobian = maps[i].determinant();
    if (jacobian > least_mapped_jacobian)
      maps[i] /= jacobian;
    else
      maps[i].setIdentity();
  }
  return maps;
}

VectorX FiniteBody::nodal_displacements(const VectorX& coefficients) const {
  if (cut_functions_ == nullptr) {
    Field field;
    field.coefficients = coefficients;
    return supports_.displacements(field);
  }
  VectorX displacements = VectorX::Zero(3 * static_cast<Eigen::Index>(size()));
  parallel_ranges(size(), 64, [&](int begin, int end) {
    ShapeFunctions shape;
    for (int i = begin; i < end; ++i) {
      shape_at(problem_.nodes.positions[i], shape);
      for (int k = 0; k < shape.size(); ++k)
        displacements.segment<3>(3 * static_cast<Eigen::Index>(i)) +=
            shape.value[k] * coefficients.segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k]));
    }
  });
  return displacements;
}

FiniteState FiniteBody::at(const Vector3& x, const VectorX& coefficients) const {
  ShapeFunctions shape;
  shape_at(x, shape);
  FiniteState state;
  for (int k = 0; k < shape.size(); ++k) {
    const Vector3 u = coefficients.segment<3>(3 * shape.nodes[k]);
    state.displacement += shape.value[k] * u;
    state.deformation += u * shape.gradient(k).transpose();
  }
  std::vector<FibreFrame> frame;
  if (fibre_field_)
    frame.push_back(fibre_field_(x));
  state.jacobian = state.deformation.determinant();
  try {
    if (prony_ == nullptr) {
      law_->evaluate({&state.deformation, 1}, frame, {&state.energy, 1}, {&state.first_piola, 1});
    } else {
      law_->evaluate_isochoric({&state.deformation, 1}, frame, {&state.energy, 1}, {&state.first_piola, 1});
      prony_->apply(static_cast<std::size_t>(places_->nearest(x).index), {&state.deformation, 1}, {&state.energy, 1},
                    {&state.first_piola, 1});
      state.energy += law_->volumetric_energy(state.jacobian);
      double cofactor[9];
      cofactor_of(state.deformation.data(), cofactor);
      state.first_piola += law_->pressure(state.jacobian) * Eigen::Map<const Matrix3>(cofactor);
    }
  } catch (const LawValueError& error) {
    throw_with_place(error, x);
  }
  state.cauchy = state.first_piola * state.deformation.transpose() / state.jacobian;
  return state;
}

} // namespace spherecut::solvers
