"""What every room stands on: errors, files, jobs, devices, compiled kernels, versions."""
