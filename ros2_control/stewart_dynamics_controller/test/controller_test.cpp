// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

// Test of the controller in a controller manager with mock hardware, without a test library:
// ends with 1 at the first check that fails. Its argument is config/leg_feed_forward.yaml.

#include <array>
#include <atomic>
#include <chrono>
#include <cstdarg>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "controller_interface/controller_interface.hpp"
#include "controller_manager/controller_manager.hpp"
#include "controller_manager_msgs/srv/switch_controller.hpp"
#include "lifecycle_msgs/msg/state.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rcutils/logging.h"

#define CHECK(condition) \
  do { \
    if (!(condition)) { \
      std::printf("%s:%d: failed: %s\n", __FILE__, __LINE__, #condition); \
      std::exit(1); \
    } \
  } while (false)

namespace
{

constexpr char kName[] = "stewart_dynamics_controller";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
using Six = std::array<double, 6>;

// Leg positions and forces of the library at rest at z = 1.1 m, for the hexapod of the example.
constexpr Six kPositions = {
  0.27728435172945987, 0.2773081968275126, 0.27730554467907464, 0.27730554467907464,
  0.2773081968275126, 0.27728435172945987};
constexpr Six kForces = {
  343.0063632692218, 344.19174337678834, 323.85555179143205, 323.3258728153354,
  360.1707947120539, 359.51385667475046};

/// Six prismatic joints with mock hardware that returns each command as state.
std::string robot()
{
  std::string joints, hardware;
  for (int n = 1; n <= 6; ++n) {
    const std::string leg = "leg_" + std::to_string(n);
    joints += "<link name=\"" + leg + "_link\"/><joint name=\"" + leg + "\" type=\"prismatic\">"
      "<parent link=\"base\"/><child link=\"" + leg + "_link\"/><axis xyz=\"0 0 1\"/>"
      "<limit lower=\"0\" upper=\"0.7\" effort=\"6000\" velocity=\"0.5\"/></joint>";
    hardware += "<joint name=\"" + leg + "\"><command_interface name=\"position\"/>"
      "<command_interface name=\"effort\"/><state_interface name=\"position\"/>"
      "<state_interface name=\"velocity\"/><state_interface name=\"effort\"/></joint>";
  }
  return "<?xml version=\"1.0\"?><robot name=\"hexapod\"><link name=\"base\"/>" + joints +
         "<ros2_control name=\"hexapod\" type=\"system\"><hardware><plugin>"
         "mock_components/GenericSystem</plugin></hardware>" + hardware +
         "</ros2_control></robot>";
}

/// Stands for a joint_trajectory_controller: writes leg positions, and reads the hardware.
class Leader : public controller_interface::ControllerInterface
{
public:
  Six positions = kPositions, commanded{}, efforts{};

  controller_interface::CallbackReturn on_init() override
  {
    return controller_interface::CallbackReturn::SUCCESS;
  }

  controller_interface::InterfaceConfiguration command_interface_configuration() const override
  {
    std::vector<std::string> names;
    for (const char * interface : {"position", "velocity", "acceleration"}) {
      for (int n = 1; n <= 6; ++n) {
        names.push_back(std::string(kName) + "/leg_" + std::to_string(n) + "/" + interface);
      }
    }
    return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
  }

  controller_interface::InterfaceConfiguration state_interface_configuration() const override
  {
    std::vector<std::string> names;
    for (const char * interface : {"position", "effort"}) {
      for (int n = 1; n <= 6; ++n) {
        names.push_back("leg_" + std::to_string(n) + "/" + interface);
      }
    }
    return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
  }

  controller_interface::return_type update(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    bool written = true;
    for (std::size_t n = 0; n < 6; ++n) {
      commanded[n] = state_interfaces_[n].get_optional<double>().value_or(kNaN);
      efforts[n] = state_interfaces_[6 + n].get_optional<double>().value_or(kNaN);
      written = command_interfaces_[n].set_value(positions[n]) &&
        command_interfaces_[6 + n].set_value(0.0) && command_interfaces_[12 + n].set_value(0.0) &&
        written;
    }
    return written ? controller_interface::return_type::OK :
           controller_interface::return_type::ERROR;
  }
};

/// Stands for the controller that the manager activates after an error: holds with its efforts.
class Fallback : public controller_interface::ControllerInterface
{
public:
  controller_interface::CallbackReturn on_init() override
  {
    return controller_interface::CallbackReturn::SUCCESS;
  }

  controller_interface::InterfaceConfiguration command_interface_configuration() const override
  {
    std::vector<std::string> names;
    for (int n = 1; n <= 6; ++n) {
      names.push_back("leg_" + std::to_string(n) + "/effort");
    }
    return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
  }

  controller_interface::InterfaceConfiguration state_interface_configuration() const override
  {
    return {controller_interface::interface_configuration_type::NONE, {}};
  }

  controller_interface::return_type update(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    bool written = true;
    for (std::size_t n = 0; n < 6; ++n) {
      written = command_interfaces_[n].set_value(kForces[n]) && written;
    }
    return written ? controller_interface::return_type::OK :
           controller_interface::return_type::ERROR;
  }
};

std::mutex log_lock;
std::string log_text;

void keep_log(
  const rcutils_log_location_t *, int, const char *, rcutils_time_point_value_t,
  const char * format, va_list * values)
{
  char line[1000];
  std::vsnprintf(line, sizeof(line), format, *values);
  const std::lock_guard<std::mutex> guard(log_lock);
  log_text += std::string(line) + "\n";
}

/// Return whether the log has a text, and forget the log.
bool logged(const std::string & text)
{
  const std::lock_guard<std::mutex> guard(log_lock);
  const bool found = log_text.find(text) != std::string::npos;
  if (!found) {
    std::printf("not in the log: %s\n%s", text.c_str(), log_text.c_str());
  }
  log_text.clear();
  return found;
}

bool close(const Six & a, const Six & b, double tolerance)
{
  for (std::size_t n = 0; n < 6; ++n) {
    if (!(std::fabs(a[n] - b[n]) <= tolerance)) {
      std::printf("leg %zu: %.17g is not %.17g\n", n + 1, a[n], b[n]);
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int count, char ** arguments)
{
  CHECK(count == 2);
  rclcpp::init(0, nullptr);
  rcutils_logging_set_output_handler(keep_log);
  auto executor = std::make_shared<rclcpp::executors::SingleThreadedExecutor>();
  auto manager = std::make_shared<controller_manager::ControllerManager>(executor, robot(), true);
  manager->set_parameter({std::string(kName) + ".params_file", std::string(arguments[1])});
  manager->set_parameter(
    {std::string(kName) + ".fallback_controllers", std::vector<std::string>{"fallback"}});
  auto controller = manager->load_controller(
    kName, "stewart_dynamics_controller/StewartDynamicsController");
  CHECK(controller != nullptr);
  auto leader = std::make_shared<Leader>();
  CHECK(manager->add_controller(leader, "leader", "leader") != nullptr);
  auto fallback = std::make_shared<Fallback>();
  CHECK(manager->add_controller(fallback, "fallback", "fallback") != nullptr);
  using controller_interface::return_type;
  CHECK(manager->configure_controller(kName) == return_type::OK);
  CHECK(manager->configure_controller("leader") == return_type::OK);
  CHECK(manager->configure_controller("fallback") == return_type::OK);

  // As fast as they are computed; the manager gives the controllers the time of its clock.
  const rclcpp::Duration period(0, 1000000);
  rclcpp::Time time(1, 0, manager->get_trigger_clock()->get_clock_type());
  const auto cycle = [&](int cycles) {
      for (int n = 0; n < cycles; ++n) {
        manager->read(time, period);
        manager->update(time, period);
        manager->write(time, period);
        time += period;
      }
    };
  const auto change = [&](std::vector<std::string> on, std::vector<std::string> off) {
      auto done = std::async(std::launch::async, [&]() {
            return manager->switch_controller(
              on, off, controller_manager_msgs::srv::SwitchController::Request::STRICT);
          });
      while (done.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
        cycle(1);
      }
      return done.get();
    };
  const auto is_active = [](const auto & of) {
      return of->get_lifecycle_state().id() == lifecycle_msgs::msg::State::PRIMARY_STATE_ACTIVE;
    };
  const auto active = [&]() {return is_active(controller);};
  CHECK(change({kName, "leader"}, {}) == return_type::OK);
  CHECK(active());

  // Position and effort reach the hardware in the same cycle.
  cycle(3);
  CHECK(close(leader->commanded, kPositions, 1e-12));
  CHECK(close(leader->efforts, kForces, 1e-6));
  leader->positions[0] += 0.01;
  cycle(2);
  CHECK(std::fabs(leader->commanded[0] - kPositions[0] - 0.01) < 1e-12);
  CHECK(std::fabs(leader->efforts[0] - kForces[0]) > 0.1);

  // NaN, or a stroke of .81 m where .70 is the most: the platform is held, the next is followed.
  for (const double wrong : {kNaN, 0.81}) {
    leader->positions = kPositions;
    cycle(2);
    leader->positions.fill(wrong);
    cycle(30);
    CHECK(active());
    CHECK(close(leader->commanded, kPositions, 1e-12));
    CHECK(close(leader->efforts, kForces, 1e-6));
  }
  CHECK(logged("longer than limits.length_max"));
  leader->positions = kPositions;
  cycle(100);
  CHECK(active());

  // Suppressed: neither an effort that is kept while positions go on, nor 0 N.
  using rclcpp::Parameter;
  const auto set = [&](const std::vector<Parameter> & parameters) {
      CHECK(controller->get_node()->set_parameters_atomically(parameters).successful);
    };
  set({Parameter("singularity.warn_condition", 1.0), Parameter("singularity.stop_condition", 1.0),
    Parameter("singularity.action", "suppress_forces")});
  leader->positions[0] += 0.01;
  cycle(30);
  CHECK(active());
  CHECK(logged("platform held, reference rejected: suppressed by singularity.action"));
  CHECK(close(leader->commanded, kPositions, 1e-12));
  CHECK(close(leader->efforts, kForces, 1e-6));
  set({Parameter("singularity.warn_condition", 20.0),
    Parameter("singularity.stop_condition", 100.0), Parameter("singularity.action", "warn")});
  leader->positions = kPositions;
  cycle(3);
  CHECK(close(leader->efforts, kForces, 1e-6));

  // Parameters set by another thread while it runs.
  std::atomic<bool> done{false};
  std::thread setter([&]() {
      for (int n = 0; n < 200; ++n) {
        set({Parameter("platform.mass", 150.0 + n)});
      }
      set({Parameter("platform.mass", 250.0)});
      done = true;
    });
  while (!done) {
    cycle(1);
  }
  setter.join();
  cycle(3);
  double heavier = 0.0;
  for (std::size_t n = 0; n < 6; ++n) {
    heavier += leader->efforts[n] - kForces[n];
  }
  CHECK(heavier > 980.0);  // the weight of 100 kg, along legs that are not upright
  set({Parameter("platform.mass", 150.0)});
  cycle(3);
  CHECK(close(leader->efforts, kForces, 1e-6));

  // No valid reference for setpoint.timeout: the manager deactivates the chain, and activates the
  // fallback.
  leader->positions[3] = kNaN;
  const auto begun = std::chrono::steady_clock::now();
  const auto elapsed = [&]() {return std::chrono::steady_clock::now() - begun;};
  while (active() && elapsed() < std::chrono::seconds(10)) {
    cycle(1);
  }
  CHECK(!active());
  CHECK(!is_active(leader));
  CHECK(is_active(fallback));
  CHECK(elapsed() > std::chrono::milliseconds(90));
  CHECK(logged("platform held for setpoint.timeout: a reference is NaN or infinite"));

  // Activated again, it starts anew.
  leader->positions = kPositions;
  CHECK(change({kName, "leader"}, {"fallback"}) == return_type::OK);
  cycle(3);
  CHECK(close(leader->efforts, kForces, 1e-6));

  // The controller before it deactivated alone: the manager activates this one again, not chained,
  // which is an error.
  CHECK(change({}, {"leader"}) == return_type::OK);
  cycle(3);
  CHECK(!active());
  CHECK(is_active(fallback));
  CHECK(logged("not chained, with reference: legs: activate and deactivate"));

  CHECK(change({kName, "leader"}, {"fallback"}) == return_type::OK);
  cycle(3);
  CHECK(close(leader->efforts, kForces, 1e-6));
  CHECK(change({}, {kName, "leader"}) == return_type::OK);
  std::printf("all checks passed\n");
  fallback.reset();
  leader.reset();
  controller.reset();
  manager.reset();
  rclcpp::shutdown();
  return 0;
}
