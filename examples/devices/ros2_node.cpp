// A ROS 2 node between a robot or a device with a driver of its own and `spherecut haptics` with device = "bridge"
// (docs/devices.md): takes geometry_msgs/PoseStamped on `pose`, gives geometry_msgs/WrenchStamped on `wrench`, 1000
// times a second. Poses are in the axes of the scenario.
//
//     ros2_node --ros-args -p port:=27510
#include "../haptic_bridge_client/bridge_client.hpp"

#include <chrono>
#include <geometry_msgs/msg/pose_stamped.hpp>
#include <geometry_msgs/msg/wrench_stamped.hpp>
#include <memory>
#include <rclcpp/rclcpp.hpp>

namespace {

class BridgeNode : public rclcpp::Node {
 public:
  BridgeNode()
      : Node("spherecut_bridge"), bridge_(static_cast<int>(declare_parameter<std::int64_t>("port", 27510))),
        wrench_(create_publisher<geometry_msgs::msg::WrenchStamped>("wrench", 1)),
        pose_(create_subscription<geometry_msgs::msg::PoseStamped>(
            "pose", 1, [this](const geometry_msgs::msg::PoseStamped& pose) { take(pose); })),
        timer_(create_wall_timer(std::chrono::milliseconds(1), [this] { tick(); })) {}

 private:
  void take(const geometry_msgs::msg::PoseStamped& stamped) {
    const auto& place = stamped.pose.position;
    const auto& turn = stamped.pose.orientation;
    const double position[3] = {place.x, place.y, place.z};
    const double orientation[4] = {turn.x, turn.y, turn.z, turn.w};
    for (int axis = 0; axis < 3; ++axis)
      motion_.position[axis] = position[axis];
    for (int i = 0; i < 4; ++i)
      motion_.orientation[i] = orientation[i];
    frame_ = stamped.header.frame_id;
    heard_ = std::chrono::steady_clock::now();
    known_ = true;
  }
  // A pose that has not come for a while is not sent on: the bridge then lets the tool go, and there is no force.
  void tick() {
    if (!known_ || std::chrono::steady_clock::now() - heard_ > std::chrono::milliseconds(100))
      return;
    const double* force = bridge_.exchange(motion_);
    geometry_msgs::msg::WrenchStamped stamped;
    stamped.header.stamp = now();
    stamped.header.frame_id = frame_;
    stamped.wrench.force.x = force[0];
    stamped.wrench.force.y = force[1];
    stamped.wrench.force.z = force[2];
    const double* torque = bridge_.torque();
    stamped.wrench.torque.x = torque[0];
    stamped.wrench.torque.y = torque[1];
    stamped.wrench.torque.z = torque[2];
    wrench_->publish(stamped);
  }

  haptic_bridge::Client bridge_;
  haptic_bridge::Motion motion_;
  std::string frame_;
  std::chrono::steady_clock::time_point heard_;
  bool known_ = false;
  rclcpp::Publisher<geometry_msgs::msg::WrenchStamped>::SharedPtr wrench_;
  rclcpp::Subscription<geometry_msgs::msg::PoseStamped>::SharedPtr pose_;
  rclcpp::TimerBase::SharedPtr timer_;
};

} // namespace

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<BridgeNode>());
  rclcpp::shutdown();
  return 0;
}
