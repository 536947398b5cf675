// A small valid scenario, and the same with single lines changed, for tests of the reader and of the command line.
#pragma once

#include <fmt/format.h>
#include <stdexcept>
#include <string>

namespace spherecut::tests {

/// A block of 60 x 60 x 30 mm, to be held and filled with nodes.
inline const std::string block_organ = R"([organ]
shape = "block"
size = [0.06, 0.06, 0.03]
edge = 0.006
[material]
young_modulus = 1e4
poisson_ratio = 0.3
)";

/// A ball that presses its top in by 2 mm.
inline const std::string ball_tool = R"([tool]
shape = "sphere_tip"
radius = 0.01
step = 0.25
[tool.approach]
target = [0, 0, 0.03]
direction = [0, 0, -1]
depth = 0.002
clearance = 0.001
)";

/// A ball pressed 2 mm into a block of about 200 nodes. Line numbers matter to the tests.
inline const std::string small_scenario = "title = \"small\"\n" + block_organ + R"([[fixed]]
name = "base"
region = "box"
lower = [-1, -1, -0.001]
upper = [1, 1, 0.001]
[nodes]
fine_spacing = 0.004
coarse_spacing = 0.012
fine_radius = 0.006
)" + ball_tool + R"([output]
figures = false
)";

/// A block of 60 x 60 x 30 mm on its base with coarse nodes, without tool or cut. Line numbers matter to the tests.
inline const std::string cut_block = block_organ + R"([[fixed]]
region = "box"
lower = [-1, -1, -0.001]
upper = [1, 1, 0.001]
[nodes]
fine_spacing = 0.005
coarse_spacing = 0.012
)";

/// A disc buried in the middle of it.
inline const std::string disc_precut = R"([[precut]]
shape = "disc"
centre = [0, 0, 0.016]
normal = [0, 0, 1]
radius = 0.01
)";

/// A rectangle as a precut; values as they stand in the file.
inline std::string rectangle_precut(const std::string& centre, const std::string& normal, const std::string& up,
                                    const std::string& width, const std::string& height) {
  return "[[precut]]\nshape = \"rectangle\"\ncentre = " + centre + "\nnormal = " + normal + "\nup = " + up +
         "\nwidth = " + width + "\nheight = " + height + "\n";
}

/// Everything below the level z is held.
inline std::string held_below(const std::string& z) {
  return "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, " + z + "]\nnormal = [0, 0, 1]\n";
}

inline std::string node_spacings(const std::string& fine, const std::string& coarse) {
  return "[nodes]\nfine_spacing = " + fine + "\ncoarse_spacing = " + coarse + "\n";
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  if (at == std::string::npos)
    throw std::logic_error("'" + from + "' is not in the text");
  return text.replace(at, from.size(), to);
}

/// A bar held at both ends and stretched between them.
inline std::string stretched_bar(double strain, double toughness, const std::string& more) {
  return fmt::format(R"([organ]
shape = "block"
size = [0.04, 0.016, 0.01]
edge = 0.004
[material]
young_modulus = 1e4
poisson_ratio = 0.3
toughness = {}
pretension = [{}, 0, 0]
[[fixed]]
region = "half_space"
point = [-0.0199, 0, 0]
normal = [1, 0, 0]
[[fixed]]
region = "half_space"
point = [0.0199, 0, 0]
normal = [-1, 0, 0]
[nodes]
fine_spacing = 0.0027
coarse_spacing = 0.005
{})",
                     toughness, strain, more);
}

/// And a notch into it from one side.
inline const std::string bar_notch = R"([[precut]]
shape = "rectangle"
centre = [0.0007, -0.008, 0.005]
normal = [1, 0.03, 0.02]
up = [0, 1, 0]
width = 0.02
height = 0.010
)";

/// One that is less deep.
inline const std::string shallow_notch = replaced(bar_notch, "height = 0.010", "height = 0.009");

/// A long bar whose front, across its middle, concerns a small part of its nodes.
inline std::string long_bar(double strain, double toughness, const std::string& more) {
  std::string text = stretched_bar(strain, toughness, more);
  text = replaced(replaced(replaced(text, "0.04, 0.016", "0.11, 0.016"), "-0.0199", "-0.0549"), "0.0199", "0.0549");
  return replaced(text, "coarse_spacing = 0.005", "coarse_spacing = 0.0034");
}

/// A cut to which the body appends what it needs.
inline const std::string by_appending = "[cut]\nsight = \"appended\"\n";
/// A cut whose bodies are made anew, in the step or in the background.
inline const std::string by_rebuilding = "[cut]\nsight = \"enriched\"\n";

/// The shallow notch, which tears on in short increments, with a cut such as those.
inline std::string growing_notch(const std::string& cut) {
  return shallow_notch + cut + "[tearing]\nstep = 0.4\n";
}

inline std::string stretched(const std::string& text) {
  return replaced(text, "poisson_ratio = 0.3", "poisson_ratio = 0.3\npretension = [0.05, 0, 0]");
}

/// A bar of which the cut at one end concerns a part alone.
inline const std::string long_block = stretched(replaced(
    replaced(replaced(cut_block, "0.06, 0.06, 0.03]", "0.24, 0.03, 0.03]"), "0.005", "0.004"), "0.012", "0.01"));
inline const std::string incision_at_end = R"([blade]
edge = [[0, -0.006, 0], [0, 0.006, 0.001]]
step = 0.2
[[blade.path]]
time = 0
position = [-0.042, 0.001, 0.033]
[[blade.path]]
time = 1
position = [-0.043, 0.001, 0.015]
)";

} // namespace spherecut::tests
