// Invariants that every checked organ surface must have.
#pragma once

#include "topology/surface/mesh.hpp"

namespace spherecut::tests {

/// V - E + F, over the vertices that triangles use.
int euler_characteristic(const topology::SurfaceMesh& mesh);

/// Requires (Catch2) that every vertex is used, every half-edge has exactly one opposite, every vertex has one fan of
/// triangles, there is one component of genus 0, and the volume is positive.
void require_closed_sphere(const topology::SurfaceMesh& mesh);

struct AngleRange {
  double smallest, largest; // degrees
};

/// Smallest and largest interior angle over all triangles.
AngleRange angle_range(const topology::SurfaceMesh& mesh);

} // namespace spherecut::tests
