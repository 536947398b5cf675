// The growing cut of a run: sheets of precuts, blade and tears, the incision they make, its level sets, and the wound.
#pragma once

#include "src/scenario/scenario.hpp"
#include "topology/blade/blade.hpp"
#include "topology/incision/cut_fields.hpp"
#include "topology/wound/wound.hpp"

namespace spherecut::app {

class IncisionBuilder {
 public:
  /// Makes the precuts of a scenario, with triangles of about `edge` m, and the wound. Throws InputError with file and
  /// line of a sheet that cannot be used or lies outside the organ.
  IncisionBuilder(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double edge);

  /// What was done to the sheets of the precuts to make them sound.
  [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }
  /// Without splinters (topology/wound/splinters.hpp).
  [[nodiscard]] const topology::Wound& wound() const { return mended_ ? *mended_ : wound_->wound(); }
  /// Null while nothing is cut.
  [[nodiscard]] const std::shared_ptr<const topology::Incision>& incision() const { return incision_; }

  /// Moves the blade and lets incision and wound grow; the first call only places it. Throws InputError and
  /// NumericalError; everything is then as it was. A motion that was not made, or taken back, is made up for by the
  /// next one: that starts where the blade last cut and passes all poses since, but for those on a straight way, which
  /// would give but narrower triangles. When a motion was refused and the blade has been out of the body since it
  /// starts there. `wound_before` (may be null) is given the wound as it was, if that grows.
  topology::SweepResult move_to(const topology::BladePose& pose, const topology::RestMap& to_rest,
                                std::optional<topology::Wound>* wound_before = nullptr);

  /// Keeps a pose for the next motion, which passes it on its way.
  void put_off(const topology::BladePose& pose);

  /// Whether the whole edge is farther from the body than its motion reaches.
  [[nodiscard]] bool is_outside(const topology::BladePose& pose, const topology::RestMap& to_rest) const;

  /// Places the blade; its next motion starts there.
  void place(const topology::BladePose& pose, const topology::RestMap& to_rest);

  /// The sheets of the incision, each continued by a tear: vertices and triangles keep their places. The blade's next
  /// strip starts a sheet of its own. Throws InputError as Incision and the wound do; all is then as it was.
  void tear(const std::vector<topology::SurfaceMesh>& grown);
  /// One sheet more, a tear where there was no cut. Throws as tear().
  void seed(topology::SurfaceMesh sheet);

  /// The cut as it is, to go back to from further motions.
  struct Mark {
    std::vector<topology::SurfaceMesh> sheets, own;
    std::shared_ptr<const topology::Incision> incision;
    std::optional<topology::BladeSweep> sweep;
    std::optional<topology::BladePose> at;
    std::vector<topology::BladePose> missed;
  };
  [[nodiscard]] Mark mark() const { return {sheets(), own_, incision_, sweep_, at_, missed_}; }
  void go_back(const Mark& mark);

  /// Brings the level sets to the incision. Throws InputError when they need too much memory.
  void update_fields();
  [[nodiscard]] const topology::CutFields& fields() const { return *fields_; }

  /// Takes the last growth back: the material there is whole again.
  void take_back();

 private:
  [[nodiscard]] std::vector<topology::SurfaceMesh> sheets() const;
  void add(topology::SurfaceMesh sheet);
  void use(const std::vector<topology::SurfaceMesh>& sheets);
  void grow(const std::vector<topology::SurfaceMesh>& sheets);

  std::vector<std::string> remarks_;
  std::shared_ptr<const topology::Domain> domain_;
  std::optional<topology::Blade> blade_;
  topology::SweepOptions options_;
  std::vector<topology::SurfaceMesh> own_;    // precuts, then seeds of tears, of a scenario without a blade
  std::optional<topology::BladeSweep> sweep_; // has them otherwise, and what the blade has cut
  std::unique_ptr<topology::IncrementalWound> wound_;
  std::optional<topology::Wound> mended_; // that wound without its splinters, where it has some
  std::unique_ptr<topology::CutFields> fields_;
  std::shared_ptr<const topology::Incision> incision_;
  int revision_ = 0;
  std::optional<topology::BladePose> at_;   // of sweep_
  std::vector<topology::BladePose> missed_; // since then
  bool refused_ = false;                    // some of these motions
  Mark before_;                             // before the last motion; missed: and the pose of that motion
};

} // namespace spherecut::app
