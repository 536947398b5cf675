#include <CGAL/Surface_mesh.h>
