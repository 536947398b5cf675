// A body of method `collocation` that follows its cut (growing_body.hpp). Private to its sources.
#pragma once

#include "solvers/algebra/lu_window.hpp"
#include "solvers/collocation/body.hpp"
#include "solvers/cut/growing_body.hpp"

#include <optional>

namespace spherecut::solvers {

class GrowingCollocation final : public Collocation, public Growable {
 public:
  GrowingCollocation(Problem problem, GrowthOptions options);

  BodyGrowth grow(const SprinkleIncrement& change, Problem grown,
                  const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) override;
  MatrixX contact_compliance(const std::vector<int>& candidates) const override;
  MatrixX compliance_between(const std::vector<int>& at, const std::vector<int>& forced) const override;

 private:
  /// What an increment makes, before it is known whether the window covers it.
  struct Next {
    std::vector<int> place, was; // of nodes before in those after, and back; -1: gone, new
    topology::CellUpdate cells;
    std::optional<Spheres> spheres;
    NodalSupports supports;
    std::vector<char> wanted; // rows made again
    std::vector<BalanceRow> rows;
    std::vector<char> changed; // rows of the system that differ
    std::vector<std::array<bool, 3>> constrained;
    std::vector<Vector3> loads;  // N
    std::vector<Vector3> places; // where the cut is new
  };

  [[nodiscard]] MatrixX solution(const MatrixX& right) const override;
  /// Whether the window has these nodes and their supports.
  [[nodiscard]] bool loads_in_window(const std::vector<int>& nodes) const;
  [[nodiscard]] bool in_window(const std::vector<int>& nodes) const;
  [[nodiscard]] MatrixX unit_forces(const std::vector<int>& nodes) const; // by slots
  [[nodiscard]] MatrixX window_solution(const MatrixX& right) const;
  [[nodiscard]] double rho() const { return collocation_support_radius(options_.method); }
  [[nodiscard]] std::vector<char> predicted_window() const;
  void make_window();
  [[nodiscard]] Next next_of(const SprinkleIncrement& change, std::vector<int> place, const Problem& grown,
                             GrowthReport& report) const;
  class SphereChange;
  void find_wanted_rows(const SphereChange& sphere_change, std::vector<char>& seen_anew, Next& next) const;
  /// An increment while it is worked on.
  struct Growing;
  void condense_anew(const char* reason, Problem problem, bool is_overwritten, Growing& growing);
  void update(const SprinkleIncrement& change, Problem grown, Growing& growing);
  void find_changed_rows(Next& next) const;
  /// Why the window does not cover it; empty: it does.
  [[nodiscard]] const char* hindrance(const Next& next, const std::vector<int>& slot) const;
  void put_in(Next next, Problem grown, const std::vector<int>& slot);
  void write_rows(const std::vector<char>& changed);
  /// Factors the window. What the next increments are not going to touch is eliminated on the way and stands until one
  /// does. Whether it stood.
  bool factor_window(const std::vector<Vector3>& places);
  void take_over(GrowingCollocation& other);

  GrowthOptions options_;
  std::unique_ptr<LuWindow> window_;
  std::vector<int> slot_;   // block of stride_ slots of every node in the window, -1 outside
  std::vector<int> origin_; // node at condensation, -1: added since
  int first_count_ = 0;     // nodes at condensation
  int next_room_ = 0;
  std::vector<Vector3> last_places_; // where the cut was new at the last increment
};

} // namespace spherecut::solvers
