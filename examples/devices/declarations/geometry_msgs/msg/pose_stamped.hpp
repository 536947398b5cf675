// Of ROS 2's geometry_msgs and std_msgs, as rclcpp/rclcpp.hpp beside it.
#pragma once

#include "../../rclcpp/rclcpp.hpp"

namespace std_msgs::msg {

struct Header {
  builtin_interfaces::msg::Time stamp;
  std::string frame_id;
};

} // namespace std_msgs::msg

namespace geometry_msgs::msg {

struct Point {
  double x = 0, y = 0, z = 0;
};
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};
struct Pose {
  Point position;
  Quaternion orientation;
};
struct PoseStamped {
  std_msgs::msg::Header header;
  Pose pose;
};

} // namespace geometry_msgs::msg
