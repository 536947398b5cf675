// A blade as it stands in a scenario.
#pragma once

#include <string>
#include <vector>

namespace spherecut::tests {

/// A blade with its edge along y, from pose to pose.
inline std::string blade(const std::vector<std::string>& positions, double half_length, const std::string& step) {
  std::string text = "[blade]\nedge = [[0, " + std::to_string(-half_length) + ", 0], [0, " +
                     std::to_string(half_length) + ", 0]]\nstep = " + step + "\n";
  int time = 0;
  for (const std::string& position : positions)
    text += "[[blade.path]]\ntime = " + std::to_string(time++) + "\nposition = " + position + "\n";
  return text;
}

/// A flap of a block, half cut off: a grasper lifts its free end by `lift` within the first half second; from the
/// second 1 on the blade cuts it on.
inline std::string lifted_flap(const std::string& law, double lift) {
  const std::string up = std::to_string(0.028 + lift);
  return "[organ]\nshape = \"block\"\nsize = [0.06, 0.016, 0.03]\nedge = 0.004\n[material]\n" + law +
         "young_modulus = 10000\npoisson_ratio = 0.3\ntoughness = 2\n[[fixed]]\nregion = \"half_space\"\npoint = [0, "
         "0, "
         "0.001]\nnormal = [0, 0, 1]\n[nodes]\nfine_spacing = 0.003\ncoarse_spacing = 0.008\n[[precut]]\nshape = "
         "\"rectangle\"\ncentre = [-0.03, 0, 0.0231]\nnormal = [0, 0, 1]\nup = [1, 0, 0]\nwidth = 0.03\nheight = 0.04\n"
         "[tool]\nshape = \"grasper\"\nradius = 0.005\nstep = 0.25\n[[tool.path]]\ntime = 0\nposition = [-0.03, 0, "
         "0.028]\n"
         "[[tool.path]]\ntime = 0.5\nposition = [-0.03, 0, " +
         up + "]\n[[tool.path]]\ntime = 1\nposition = [-0.03, 0, " + up + "]\n" +
         blade({"[-0.045, 0, 0.0231]", "[-0.0135, 0, 0.0231]", "[-0.001, 0, 0.0231]"}, 0.012, "0.25");
}

} // namespace spherecut::tests
