// The growing cut of a run: sheets of precuts and blade, the incision they make, its level sets, and the wound.
#pragma once

#include "src/scenario.hpp"
#include "topology/blade.hpp"
#include "topology/cut_fields.hpp"
#include "topology/wound.hpp"

namespace spherecut::app {

class IncisionBuilder {
 public:
  /// Makes the precuts of a scenario, with triangles of about `edge` m, and the wound. Throws InputError with file and
  /// line of a sheet that cannot be used or lies outside the organ.
  IncisionBuilder(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double edge);

  [[nodiscard]] const topology::Wound& wound() const { return wound_->wound(); }
  /// Null while nothing is cut.
  [[nodiscard]] const std::shared_ptr<const topology::Incision>& incision() const { return incision_; }

  /// Moves the blade and lets incision and wound grow; the first call only places it. Throws InputError and
  /// NumericalError; everything is then as it was, and the blade is placed at the pose.
  topology::SweepResult move_to(const topology::BladePose& pose, const topology::RestMap& to_rest);

  /// Brings the level sets to the incision. Throws InputError when they need too much memory.
  void update_fields();
  [[nodiscard]] const topology::CutFields& fields() const { return *fields_; }

  /// Takes the last growth back: the material there is whole again. The blade is placed at the pose, for the next
  /// motion to start from.
  void take_back(const topology::BladePose& pose, const topology::RestMap& to_rest);

 private:
  [[nodiscard]] std::vector<topology::SurfaceMesh> sheets() const;
  void start_blade();

  std::shared_ptr<const topology::Domain> domain_;
  std::optional<topology::Blade> blade_;
  topology::SweepOptions options_;
  std::vector<topology::SurfaceMesh> earlier_; // precuts, then what the blade cut before it was last started anew
  std::unique_ptr<topology::BladeSweep> sweep_;
  std::unique_ptr<topology::IncrementalWound> wound_;
  std::unique_ptr<topology::CutFields> fields_;
  std::shared_ptr<const topology::Incision> incision_;
  int revision_ = 0;
  std::vector<topology::SurfaceMesh> sheets_before_; // before the last growth
  std::shared_ptr<const topology::Incision> incision_before_;
};

} // namespace spherecut::app
