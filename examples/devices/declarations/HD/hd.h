/* What openhaptics_touch.cpp calls of OpenHaptics' HD API, and no more: enough to compile it. The SDK's own header
 * takes this one's place where a program is built; the values of the constants here mean nothing. */
#pragma once

#define HDCALLBACK
#define HD_DEFAULT_DEVICE nullptr
#define HD_CURRENT_TRANSFORM 0x2053
#define HD_CURRENT_BUTTONS 0x2000
#define HD_CURRENT_FORCE 0x2700
#define HD_FORCE_OUTPUT 0x4000
#define HD_SUCCESS 0x0000
#define HD_MAX_SCHEDULER_PRIORITY 0xFFFF
#define HD_CALLBACK_DONE 0
#define HD_CALLBACK_CONTINUE 1
#define HD_DEVICE_ERROR(error) ((error).errorCode != HD_SUCCESS)

typedef unsigned int HHD;
typedef unsigned int HDenum;
typedef unsigned int HDerror;
typedef int HDint;
typedef double HDdouble;
typedef unsigned int HDCallbackCode;
typedef unsigned long HDSchedulerHandle;
typedef unsigned short HDushort;
typedef const char* HDstring;
typedef HDCallbackCode(HDCALLBACK* HDSchedulerCallback)(void*);
typedef struct {
  HDerror errorCode;
  int internalErrorCode;
  HHD hHD;
} HDErrorInfo;

extern "C" {
HHD hdInitDevice(HDstring name);
void hdDisableDevice(HHD device);
HHD hdGetCurrentDevice(void);
void hdBeginFrame(HHD device);
void hdEndFrame(HHD device);
void hdEnable(HDenum capability);
void hdGetDoublev(HDenum name, HDdouble* values);
void hdGetIntegerv(HDenum name, HDint* values);
void hdSetDoublev(HDenum name, const HDdouble* values);
HDErrorInfo hdGetError(void);
HDstring hdGetErrorString(HDerror code);
HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void* data, HDushort priority);
void hdUnschedule(HDSchedulerHandle handle);
void hdStartScheduler(void);
void hdStopScheduler(void);
}
