// What ros2_node.cpp calls of ROS 2's rclcpp, and no more: enough to compile it. The library's own header takes this
// one's place where a program is built.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace builtin_interfaces::msg {

struct Time {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
};

} // namespace builtin_interfaces::msg

namespace rclcpp {

class Time {
 public:
  operator builtin_interfaces::msg::Time() const;
};

class QoS {
 public:
  QoS(std::size_t depth);
};

template <typename Message>
class Publisher {
 public:
  using SharedPtr = std::shared_ptr<Publisher>;
  void publish(const Message& message);
};

template <typename Message>
class Subscription {
 public:
  using SharedPtr = std::shared_ptr<Subscription>;
};

class TimerBase {
 public:
  using SharedPtr = std::shared_ptr<TimerBase>;
};

class Node {
 public:
  explicit Node(const std::string& name);
  virtual ~Node();
  template <typename Value>
  Value declare_parameter(const std::string& name, const Value& otherwise);
  template <typename Message>
  typename Publisher<Message>::SharedPtr create_publisher(const std::string& topic, const QoS& quality);
  template <typename Message>
  typename Subscription<Message>::SharedPtr create_subscription(const std::string& topic, const QoS& quality,
                                                                std::function<void(const Message&)> callback);
  TimerBase::SharedPtr create_wall_timer(std::chrono::nanoseconds period, std::function<void()> callback);
  Time now() const;
};

void init(int argc, char const* const* argv);
void spin(std::shared_ptr<Node> node);
bool shutdown();

} // namespace rclcpp
