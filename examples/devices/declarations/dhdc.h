/* What force_dimension.cpp calls of the DHD library of Force Dimension's SDK, and no more: enough to compile it. The
 * SDK's own header takes this one's place where a program is built. */
#pragma once

#define DHD_ON 1

extern "C" {
int dhdOpen(void);
int dhdClose(char ID = -1);
const char* dhdErrorGetLastStr(void);
int dhdEnableForce(unsigned char val, char ID = -1);
bool dhdHasWrist(char ID = -1);
int dhdGetPosition(double* px, double* py, double* pz, char ID = -1);
int dhdGetOrientationFrame(double matrix[3][3], char ID = -1);
unsigned int dhdGetButtonMask(char ID = -1);
int dhdSetForce(double fx, double fy, double fz, char ID = -1);
}
