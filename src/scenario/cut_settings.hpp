// The cutting part of a scenario: sheets that are there from the start, how the cut is computed, the blade and its way.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "solvers/contact/lip_contact.hpp"

#include <filesystem>
#include <optional>
#include <variant>
#include <vector>

namespace spherecut::app {

struct DiscSheet {
  Vector3 centre, normal; // m; unit vector
  double radius = 0;      // m
};
struct RectangleSheet {
  Vector3 centre, normal, up;   // m; unit vectors, up perpendicular to normal
  double width = 0, height = 0; // m, along up x normal and along up
};
struct PolygonSheet {
  std::vector<Vector3> points; // m, in order around it
};
struct SheetFile {
  std::filesystem::path file; // resolved against the scenario's folder
  double scale = 1;           // m per unit of the file
};

struct PrecutSettings {
  std::variant<DiscSheet, RectangleSheet, PolygonSheet, SheetFile> shape;
  double pressure = 0; // Pa on both faces, opening them
  int line = 0;        // of the scenario file
};

struct CutSettings {
  std::optional<solvers::SightRule> sight; // empty: as sight_of() has it
  solvers::LipCondition lips = solvers::LipCondition::frictionless;
  solvers::UnheldPieces unheld = solvers::UnheldPieces::hold; // a piece that no fixed region holds
  double front_spacing = 0;                                   // m, 0: derived
};

/// Where the frame of the blade is at a time.
struct BladePoint {
  double time = 0;                    // s
  Vector3 position = Vector3::Zero(); // m, origin of the blade's frame
  Vector3 rotation = Vector3::Zero(); // degrees, about the axis along this vector by its length
};

struct BladeSettings {
  std::vector<Vector3> edge;     // m, in the blade's frame, from end to end
  double edge_radius = 0;        // m
  double sharpness = 1;          // share of the edge's work that makes new surface
  double friction = 0;           // Pa, shear of the flanks
  double flank = 0;              // m behind the edge as far as they touch
  double step = 0;               // s, 0: derived
  std::optional<double> advance; // fine spacings the blade goes before the body follows its cut; empty: derived
  std::vector<BladePoint> path;  // in order of time
  int line = 0;                  // of the scenario file
};

} // namespace spherecut::app
