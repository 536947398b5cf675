// Problem:   two slits 0.95 and 0.65 m long that cross at 60 degrees in a plate 2 m wide, pulled alike on all its
//            sides; plane strain, nu = 0.3. The plate is 0.3 m thick between sliding sides and stands askew between the
//            axes, and along them.
// Reference: CalculiX and GetFEM, two meshes each (reference.csv, made by experiments/reference/slits.py). Errors are
//            the largest along a slit, at 7 places of every straight part and three across the thickness, over the
//            largest opening of that slit: of the whole vector, across and along the slit.
// Command:   spherecut experiment run precut_crossing --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/plane_slits.hpp"
#include "slit_tables.hpp" // made by CMake

namespace spherecut::experiments {

std::vector<Check> run_precut_crossing(const ExperimentContext& context) {
  return run_plane_slits(context, "precut_crossing", "Two crossing slits under biaxial tension: openings",
                         read_plane_slits(crossing_slit_table), 0.03);
}

} // namespace spherecut::experiments
