// Of ROS 2's geometry_msgs, as rclcpp/rclcpp.hpp beside it.
#pragma once

#include "pose_stamped.hpp"

namespace geometry_msgs::msg {

struct Vector3 {
  double x = 0, y = 0, z = 0;
};
struct Wrench {
  Vector3 force, torque;
};
struct WrenchStamped {
  std_msgs::msg::Header header;
  Wrench wrench;
};

} // namespace geometry_msgs::msg
