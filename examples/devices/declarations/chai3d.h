/* What chai3d_device.cpp calls of CHAI3D 3.2, and no more: enough to compile it. CHAI3D's own header takes this one's
 * place where a program is built. */
#pragma once

#include <memory>

namespace chai3d {

class cVector3d {
 public:
  cVector3d();
  cVector3d(double x, double y, double z);
  double& operator()(unsigned int index);
  const double& operator()(unsigned int index) const;

 private:
  double m_data[3];
};

class cMatrix3d {
 public:
  cMatrix3d();
  double& operator()(unsigned int row, unsigned int column);
  const double& operator()(unsigned int row, unsigned int column) const;

 private:
  double m[3][3];
};

class cGenericHapticDevice {
 public:
  virtual ~cGenericHapticDevice();
  virtual bool open();
  virtual bool close();
  virtual bool calibrate(bool force = false);
  virtual bool getPosition(cVector3d& position);
  virtual bool getRotation(cMatrix3d& rotation);
  virtual bool getUserSwitches(unsigned int& switches);
  bool setForce(const cVector3d& force);
};
typedef std::shared_ptr<cGenericHapticDevice> cGenericHapticDevicePtr;

class cHapticDeviceHandler {
 public:
  cHapticDeviceHandler();
  virtual ~cHapticDeviceHandler();
  bool getDevice(cGenericHapticDevicePtr& device, unsigned int index = 0);
};

} // namespace chai3d
