# Checks of cmake/SpherecutUnity.cmake under -DROOT=folder, run as cmake -P: what a source declares in unnamed namespaces, and
# that in no target two sources of one unit have such a name in common (-DUNITS=a build tree).
cmake_minimum_required(VERSION 3.25)
include("${ROOT}/cmake/SpherecutUnity.cmake")

set(source "${UNITS}/unity_names_example.cpp")
file(WRITE "${source}" [=[
#include <vector>

int outside(int a);

namespace example {
namespace {

constexpr double radius = 0.5, length{2}; // m, not = this
constexpr std::array<int, 2> places{1, 2};
const std::vector<double> widths = {1, 2};
int counter;
using Numbers = std::vector<double>;
using std::swap;

class Walker final : public Base {
 public:
  void step() { inside(3); }
};
enum class Side { left, right };

/// A function.
std::vector<double> doubled(const std::vector<double>& values, int times,
                            bool sorted) {
  int local = 0;
  return values;
}

template <class T>
T halved(T value) {
  return value / 2;
}

void Walker::member() {}

constexpr const char* text = R"(
edge_radius = 1e-4
)";

} // namespace

int shown(int a) { return a; }

namespace {

bool second_block(int a) {
  return a > 0;
}

} // namespace
} // namespace example
]=])
spherecut_unnamed_names("${source}" names)
set(expected counter doubled halved length Numbers places radius second_block Side text Walker widths)
list(SORT names CASE INSENSITIVE)
list(SORT expected CASE INSENSITIVE)
if(NOT names STREQUAL expected)
  message(FATAL_ERROR "names of unnamed namespaces: ${names}\nexpected: ${expected}")
endif()

file(STRINGS "${UNITS}/compile_commands.json" units REGEX "\"file\": .*/Unity/unity_")
list(TRANSFORM units REPLACE "^.*\"file\": \"([^\"]*)\".*$" "\\1")
set(offences "")
foreach(unit IN LISTS units)
  set(seen "")
  file(STRINGS "${unit}" lines REGEX "^#include \"${ROOT}/")
  foreach(line IN LISTS lines)
    string(REGEX REPLACE "^#include \"(.*)\"$" "\\1" file "${line}")
    if(NOT EXISTS "${file}")
      continue()
    endif()
    spherecut_unnamed_names("${file}" names)
    foreach(name IN LISTS names)
      if(name IN_LIST seen)
        string(APPEND offences "  ${name}: again in ${file}, of ${unit}\n")
      endif()
    endforeach()
    list(APPEND seen ${names})
  endforeach()
endforeach()
if(offences)
  message(FATAL_ERROR "names of unnamed namespaces that meet in a unit:\n${offences}")
endif()
list(LENGTH units count)
message(STATUS "${count} units")
