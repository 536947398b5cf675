// Fronts of a body's cut: their states, and how its sheets go on from them.
#pragma once

#include "solvers/fracture/tearing.hpp"
#include "src/blade/force.hpp"
#include "src/model/body_model.hpp"
#include "src/model/node_zone.hpp"
#include "topology/incision/front_growth.hpp"

namespace spherecut::app {

/// All models that it is asked for are solved, those of grow() and join() have a cut.
class TearFronts {
 public:
  /// `toughness`, J/m2, in the tissue at rest. All of these must outlive it.
  TearFronts(const Scenario& scenario, const std::function<double(const Vector3&)>& toughness, const FineZone& zone)
      : scenario_(scenario), toughness_(toughness), zone_(zone) {}

  /// Along all fronts but where they have met another sheet. Throws NumericalError where they are too near to the
  /// surface for intensities all along.
  [[nodiscard]] std::vector<solvers::FrontState> states(const BodyModel& model) const;
  /// The same, nothing in place of the error.
  [[nodiscard]] std::optional<std::vector<solvers::FrontState>> known_states(const BodyModel& model) const;

  /// The sheets continued as far as these states ask for, `longest` m where most is released; without states by that
  /// everywhere.
  [[nodiscard]] topology::FrontGrowth grow(const BodyModel& model, const std::vector<solvers::FrontState>& states,
                                           double longest) const;
  /// Two fronts that have come so near to each other that the ligament between them is not resolved part it, once one
  /// of them moves. No triangles: there are no such fronts.
  [[nodiscard]] topology::FrontGrowth join(const BodyModel& model,
                                           const std::vector<solvers::FrontState>& states) const;
  /// A crack across the largest stress, where that reaches the strength off every cut, held region and tool.
  [[nodiscard]] std::optional<topology::SurfaceMesh> seed(const BodyModel& model) const;

  /// The tissue between a front and the surface, m, along the normal of the sheet, at the place of largest G / G_c away
  /// from where the front meets the surface; nothing where it is thicker than `least` fine spacings.
  struct ThinLayer {
    Vector3 place;
    double thickness = 0; // m
  };
  [[nodiscard]] std::optional<ThinLayer> thin_layer(const BodyModel& model,
                                                    const std::vector<solvers::FrontState>& states, double least) const;

  /// What the loads on the body, without the blade, release as the front goes on at these places, J/m2: the sum of
  /// their shares, each times the mean over the front within two fine spacings, by its intensities. Two bodies'
  /// energies would tell it too, but nodes differ between them. 0 where nothing loads the body; nothing where it is not
  /// known.
  [[nodiscard]] std::optional<double> released(const BodyModel& model, const std::vector<FrontPlace>& places) const;

 private:
  [[nodiscard]] std::vector<solvers::FrontState> found_states(const BodyModel& model) const;

  const Scenario& scenario_;
  const std::function<double(const Vector3&)>& toughness_;
  const FineZone& zone_;
};

} // namespace spherecut::app
