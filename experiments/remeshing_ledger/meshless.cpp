// This project's own back end: unknowns appended for the increment, nodes exchanged near it, or everything anew.
#include "experiments/remeshing_ledger/back_end.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/exchanged_nodes.hpp"
#include "solvers/appended/appended_body.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::experiments::ledger {

namespace {

using solvers::Method;

class Meshless final : public BackEnd {
 public:
  Meshless(const Scenario& scenario, const Resolution& resolution, bool galerkin, Upkeep upkeep)
      : scenario_(scenario), resolution_(resolution), upkeep_(upkeep), number_(resolution.first) {
    options_.method = galerkin ? Method::galerkin : Method::collocation;
    options_.estimate_condition = false;
    if (galerkin && upkeep == Upkeep::update)
      options_.sight = solvers::SightRule::appended;
  }

  std::string name() const override {
    const char* upkeep = upkeep_ == Upkeep::update ? "_update" : "_scratch";
    return "meshless_" + std::string(solvers::to_string(options_.method)) + upkeep;
  }

  Increment start() override { return make_anew(Increment{}); }

  bool may_skip() const override { return upkeep_ == Upkeep::scratch; }

  Increment advance(int to) override {
    Increment increment;
    number_ = to;
    if (upkeep_ == Upkeep::scratch)
      return make_anew(increment);
    std::shared_ptr<const topology::Incision> before = incision_;
    solvers::SprinkleOptions options;
    {
      const StageClock clock(increment.times, Stage::topology);
      incision_ = std::make_shared<topology::Incision>(std::vector{scenario_.sheet(number_)}, scenario_.domain);
      options = sprinkle_options();
    }
    solvers::SprinkleIncrement change;
    try {
      const StageClock clock(increment.times, Stage::meshing);
      options.spacing = spacing_;
      change = solvers::extend_sprinkling(*scenario_.domain, options, nodes_, before.get());
      nodes_ = exchanged(nodes_, change);
    } catch (const NumericalError& error) {
      return make_anew(std::move(increment));
    }
    if (auto* appended = dynamic_cast<solvers::AppendedBody*>(body_.get())) {
      const double processor = processor_seconds(), wall = wall_seconds();
      const bool has_followed = appended->grow(change, problem()).empty();
      share_out(increment, processor_seconds() - processor, wall_seconds() - wall, body_->report());
      if (has_followed)
        return solved(std::move(increment));
      increment.anew = true;
    }
    return discretise(std::move(increment));
  }

  Opening opening() const override {
    Opening opening;
    const solvers::Discretisation& b = *body_;
    const auto jump = [&](const Vector3& x) {
      return opening_at(b, field_, x, scenario_.frame.normal, spacing_.finest()).dot(scenario_.frame.normal);
    };
    opening.volume = 0;
    double error = 0, size = 0;
    for (const FacePoint& point : face_points(scenario_, number_)) {
      const double found = jump(point.position);
      opening.volume += point.area * found;
      if (scenario_.exact_opening) {
        const double wanted = scenario_.exact_opening(point.position);
        error += point.area * (found - wanted) * (found - wanted);
        size += point.area * wanted * wanted;
      }
    }
    if (scenario_.exact_opening)
      opening.profile_error = std::sqrt(error / size);
    opening.marked = jump(scenario_.marked);
    if (!scenario_.force_direction.isZero(0)) {
      opening.force = 0;
      const std::vector<Vector3> forces = b.constraint_forces(field_);
      for (std::size_t k = 0; k < forces.size(); ++k)
        if (scenario_.tool(b.problem().nodes.positions[static_cast<std::size_t>(b.problem().prescribed[k].node)]))
          opening.force += forces[k].dot(scenario_.force_direction);
    }
    return opening;
  }

  double condition() const override {
    solvers::DiscretisationOptions options = options_;
    options.estimate_condition = true;
    return solvers::discretise(body_->problem(), options)->report().condition_estimate;
  }

 private:
  /// Made anew the nodes are fine where the front is; nodes that stay must be fine wherever it will come to be.
  solvers::SprinkleOptions sprinkle_options() {
    solvers::SprinkleOptions options;
    options.incision = incision_;
    options.ring_ahead = solvers::wants_ring_ahead(options_.method);
    options.lips_apart = options_.sight == solvers::SightRule::appended;
    solvers::SpacingField& spacing = options.spacing;
    spacing.fine = resolution_.fine;
    spacing.coarse = resolution_.coarse_over_fine * resolution_.fine;
    spacing.slope = resolution_.slope;
    spacing.segments = solvers::front_segments(*incision_, 0.1 * scenario_.size);
    if (upkeep_ != Upkeep::scratch) {
      const double way = (scenario_.increments - number_) * scenario_.advance;
      const topology::Incision last({scenario_.sheet(scenario_.increments)}, scenario_.domain);
      for (const auto& segment : solvers::front_segments(last, 0.1 * scenario_.size))
        spacing.segments.push_back(segment);
      if (!front_of(scenario_, number_).closed) { // between the first place of the leading edge and the last
        const auto leading = [&](int k) {
          const std::vector<Vector2> outline = scenario_.outline(k);
          return std::array<Vector3, 2>{scenario_.in_space(outline[1]), scenario_.in_space(outline[2])};
        };
        const int stations = std::max(1, static_cast<int>(way / resolution_.fine));
        for (int i = 1; i < stations; ++i)
          spacing.segments.push_back(leading(number_ + (scenario_.increments - number_) * i / stations));
      }
    }
    return options;
  }

  solvers::Problem problem() const {
    solvers::Problem p;
    p.domain = scenario_.domain;
    p.incision = incision_;
    p.nodes = nodes_;
    p.material = scenario_.material;
    hold_surface(p, scenario_.held, scenario_.displacement);
    if (scenario_.pressure != 0)
      p.loads.lip_traction = [pressure = scenario_.pressure](const Vector3&, const Vector3& n) -> Vector3 {
        return -pressure * n;
      };
    return p;
  }

  Increment make_anew(Increment increment) {
    increment.anew = true;
    {
      const StageClock clock(increment.times, Stage::topology);
      incision_ = std::make_shared<topology::Incision>(std::vector{scenario_.sheet(number_)}, scenario_.domain);
    }
    {
      const StageClock clock(increment.times, Stage::meshing);
      const solvers::SprinkleOptions options = sprinkle_options();
      spacing_ = options.spacing;
      nodes_ = solvers::sprinkle(*scenario_.domain, options).nodes;
    }
    return discretise(std::move(increment));
  }

  Increment discretise(Increment increment) {
    const double processor = processor_seconds(), wall = wall_seconds();
    body_.reset();
    body_ = options_.sight == solvers::SightRule::appended ? solvers::make_appended(problem(), options_, uncut_)
                                                           : solvers::discretise(problem(), options_);
    share_out(increment, processor_seconds() - processor, wall_seconds() - wall, body_->report());
    return solved(std::move(increment));
  }

  /// What the library reports by the wall clock, as shares of the processor time.
  static void share_out(Increment& increment, double processor, double wall, const solvers::AssemblyReport& report) {
    const double supports = std::min(report.supports_seconds, wall);
    const double factor = std::min(report.factor_seconds, wall - supports);
    const auto add = [&](Stage stage, double seconds) {
      increment.times.add(stage, wall > 0 ? processor * seconds / wall : 0, seconds);
    };
    add(Stage::neighbours, supports);
    add(Stage::factorisation, factor);
    add(Stage::assembly, wall - supports - factor);
  }

  Increment solved(Increment increment) {
    {
      const StageClock clock(increment.times, Stage::solve);
      field_ = body_->solve();
    }
    increment.number = number_;
    increment.unknowns = body_->coefficient_count();
    increment.quality = 1 / std::max(1.0, body_->report().worst_moment_condition);
    return increment;
  }

  Scenario scenario_;
  Resolution resolution_;
  Upkeep upkeep_;
  int number_;
  solvers::DiscretisationOptions options_;
  std::shared_ptr<const topology::Incision> incision_;
  solvers::SpacingField spacing_;
  solvers::NodeCloud nodes_;
  std::unique_ptr<solvers::Discretisation> body_;
  std::shared_ptr<const solvers::UncutBody> uncut_; // of a body whose cut only appends
  solvers::Field field_;
};

} // namespace

std::unique_ptr<BackEnd> make_meshless(const Scenario& scenario, const Resolution& resolution, bool galerkin,
                                       Upkeep upkeep) {
  return std::make_unique<Meshless>(scenario, resolution, galerkin, upkeep);
}

} // namespace spherecut::experiments::ledger
