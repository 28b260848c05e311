# A shell in which `ros2 run <package> <executable>` works:   source env.sh
# Reads the workspace that `make build` made, or the virtual environment in which the wheels of
# `make dist` are installed. Without either it falls back on a system ROS 2.

if [ -n "${BASH_SOURCE:-}" ]; then
    _cassie_root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
elif [ -n "${ZSH_VERSION:-}" ]; then
    eval '_cassie_root=$(cd "$(dirname "${(%):-%x}")" && pwd)'
else
    _cassie_root=$(pwd) # a plain sh does not say which file it reads
fi

_cassie_venv=
if [ -f "$_cassie_root/.venv/made_from" ] && [ -f "$_cassie_root/install/local_setup.sh" ]; then
    _cassie_venv=$_cassie_root/.venv
    _cassie_bin=$_cassie_root/.workspace/bin
elif [ -f "$_cassie_root/bin/ros2" ]; then # this is share/cassie_msgs of a virtual environment
    _cassie_venv=$(cd "$_cassie_root/../.." && pwd)
    _cassie_bin=$_cassie_root/bin
fi

if [ -n "$_cassie_venv" ]; then
    # Nothing of another ROS may shine through.
    unset PYTHONPATH PYTHONHOME COLCON_PREFIX_PATH COLCON_CURRENT_PREFIX
    export AMENT_PREFIX_PATH="$_cassie_venv" CMAKE_PREFIX_PATH="$_cassie_venv"
    export VIRTUAL_ENV="$_cassie_venv"
    export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
    # The wheels keep their libraries here; with the path set at once, Python need not start twice.
    LD_LIBRARY_PATH=$_cassie_venv/lib
    for _cassie_libs in "$_cassie_venv"/lib/python3.*/site-packages/ros_*.libs; do
        [ -d "$_cassie_libs" ] && LD_LIBRARY_PATH=$LD_LIBRARY_PATH:$_cassie_libs
    done
    export LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
    # MuJoCo's import looks for GLFW with a process of its own, which Ctrl-C makes cry out: name it.
    _cassie_glfw=${PYGLFW_LIBRARY_VARIANT:-${XDG_SESSION_TYPE:-x11}}
    [ "$_cassie_glfw" = wayland ] || _cassie_glfw=x11
    for _cassie_glfw in "$_cassie_venv"/lib/python3.*/site-packages/glfw/"$_cassie_glfw"/libglfw.so; do
        [ -f "$_cassie_glfw" ] && export PYGLFW_LIBRARY="$_cassie_glfw"
    done
    # Ahead of everything, and not once more in a shell that sources this again.
    case ":$PATH:" in
    *":$_cassie_bin:$_cassie_venv/bin:"*) ;;
    *) export PATH="$_cassie_bin:$_cassie_venv/bin:$PATH" ;;
    esac
    if [ -d "$_cassie_root/.workspace" ]; then
        . "$_cassie_root/install/local_setup.sh"
    fi
elif [ "${ROS_DISTRO:-}" = jazzy ] && [ -f "$_cassie_root/install/local_setup.sh" ]; then
    . "$_cassie_root/install/local_setup.sh"
else
    echo "env.sh: nothing is built in $_cassie_root yet: run make build there first" >&2
    unset _cassie_root _cassie_venv
    return 1 2>/dev/null || exit 1
fi

export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
if [ -d "$_cassie_root/.workspace" ]; then
    export ROS_LOG_DIR="${ROS_LOG_DIR:-$_cassie_root/build/ros_log}"
fi
# The matrices here are small: more than one thread costs time and the order of sums.
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
# OpenBLAS then sums in the same order on processors with AVX2 and FMA, whatever else they can: the
# last bit of a sum decides where a run is at its limits.
if grep -qs '^flags.* avx2 ' /proc/cpuinfo && grep -qs '^flags.* fma ' /proc/cpuinfo; then
    export OPENBLAS_CORETYPE="${OPENBLAS_CORETYPE:-Haswell}"
    export NPY_DISABLE_CPU_FEATURES="${NPY_DISABLE_CPU_FEATURES:-X86_V4 AVX512_ICL AVX512_SPR}"
fi
case "$-${BASH_VERSION:+b}" in
*i*b) [ -x "$_cassie_venv/bin/register-python-argcomplete" ] &&
    eval "$("$_cassie_venv/bin/register-python-argcomplete" ros2)" ;;
esac
unset _cassie_root _cassie_venv _cassie_bin _cassie_libs _cassie_glfw
