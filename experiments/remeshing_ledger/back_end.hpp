// One interface for everything that follows a growing cut, and what is booked about each increment.
#pragma once

#include "experiments/remeshing_ledger/scenario.hpp"

#include <array>
#include <memory>
#include <string_view>

namespace spherecut::experiments::ledger {

enum class Stage { topology, meshing, neighbours, assembly, factorisation, solve };
inline constexpr int stage_count = 6;
inline constexpr std::array<std::string_view, stage_count> stage_names{"topology", "meshing",       "neighbours",
                                                                       "assembly", "factorisation", "solve"};

/// Seconds by stage, of this thread's processor and of the wall clock.
struct StageTimes {
  std::array<double, stage_count> processor{}, wall{};
  [[nodiscard]] double total_processor() const;
  [[nodiscard]] double total_wall() const;
  void add(Stage stage, double processor_seconds, double wall_seconds) {
    processor[static_cast<std::size_t>(stage)] += processor_seconds;
    wall[static_cast<std::size_t>(stage)] += wall_seconds;
  }
};

double processor_seconds(); // of this thread
double wall_seconds();

/// Adds its lifetime to a stage.
class StageClock {
 public:
  StageClock(StageTimes& times, Stage stage) : times_(times), stage_(stage) {}
  ~StageClock() { times_.add(stage_, processor_seconds() - processor_, wall_seconds() - wall_); }
  StageClock(const StageClock&) = delete;
  StageClock& operator=(const StageClock&) = delete;

 private:
  StageTimes& times_;
  Stage stage_;
  double processor_ = processor_seconds(), wall_ = wall_seconds();
};

/// What came of one increment. NaN: not measured.
struct Increment {
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  int number = 0;
  StageTimes times;
  int unknowns = 0;
  bool anew = false;        // what should have been kept was made anew
  double mesher_memory = 0; // bytes, of a process of its own
  std::string failure;      // why there is no result; empty: there is
  double quality = unknown; // smallest shape of an element, 1 for a regular one, or 1 / largest moment condition
};

/// What the ledger asks of the last increment's solution; outside the times.
struct Opening {
  double volume = Increment::unknown;        // m3
  double marked = Increment::unknown;        // m, along the normal
  double force = Increment::unknown;         // N, of the tool
  double profile_error = Increment::unknown; // relative L2 error over the faces, where the exact opening is known
};

class BackEnd {
 public:
  virtual ~BackEnd() = default;
  [[nodiscard]] virtual std::string name() const = 0;
  /// Makes the body with cut number 0 and whatever is prepared ahead.
  virtual Increment start() = 0;
  /// The body with the cut of that number, solved. Whoever makes everything anew may leave some out.
  virtual Increment advance(int to) = 0;
  [[nodiscard]] virtual bool may_skip() const = 0;
  [[nodiscard]] virtual Opening opening() const = 0;
  /// 1-norm estimate of the condition of the system as it stands (some more solves).
  [[nodiscard]] virtual double condition() const = 0;
};

/// What one back end is run with; `fine` is the size at the front that the error-cost curve is walked with, m.
struct Resolution {
  double fine = 0;
  double slope = 0.35;
  double coarse_over_fine = 4;
  int first = 0; // number of the cut that it starts with
};

enum class Upkeep {
  update,  // galerkin: the cut appends unknowns; collocation: nodes exchanged near the increment, the system anew
  scratch, // everything anew
};
std::unique_ptr<BackEnd> make_meshless(const Scenario& scenario, const Resolution& resolution, bool galerkin,
                                       Upkeep upkeep);

enum class Element { linear, quadratic, quarter_point };
std::string_view to_string(Element element);
/// CGAL's Mesh_3 at every increment. `limit`: seconds a mesh may take.
std::unique_ptr<BackEnd> make_fem_remesh(const Scenario& scenario, const Resolution& resolution, Element element,
                                         double limit);

/// The tetrahedra about the new strip of the cut are taken out and others put in, the rest stays and its far part
/// condensed. Without TetGen every increment is recorded as a failure.
std::unique_ptr<BackEnd> make_fem_local_remesh(const Scenario& scenario, const Resolution& resolution, Element element,
                                               double limit);
/// The mesh is carried along with the front, the far part stays condensed; meshed anew when it is worn.
std::unique_ptr<BackEnd> make_fem_carried(const Scenario& scenario, const Resolution& resolution, Element element,
                                          double limit);
/// Linear tetrahedra split along the sheet.
std::unique_ptr<BackEnd> make_fem_split(const Scenario& scenario, const Resolution& resolution, double limit);
/// Tetrahedra of the uncut organ, enriched at the cut; GetFEM cuts them. Null where the build has no GetFEM.
std::unique_ptr<BackEnd> make_xfem(const Scenario& scenario, const Resolution& resolution, Element element,
                                   double limit);
bool has_xfem();

} // namespace spherecut::experiments::ledger
