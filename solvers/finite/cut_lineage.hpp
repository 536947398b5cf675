// What bodies whose cut appends hand on, from one to the next with a longer cut.
#pragma once

#include <memory>

namespace spherecut::solvers {

class UncutFunctions; // solvers/finite/cut_functions.hpp
class UncutTangent;   // solvers/finite/bordered_operator.hpp
struct KeptBorder;    // likewise

/// Each is null where it is not there yet. All are immutable: bodies that go on from the same one are the same.
struct CutLineage {
  std::shared_ptr<const UncutFunctions> uncut;
  std::shared_ptr<const UncutTangent> tangent; // of the uncut body
  std::shared_ptr<const KeptBorder> border;    // of the last cut
};

} // namespace spherecut::solvers
