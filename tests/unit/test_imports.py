"""What is imported, and what is not waited for."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.one_processor


def test_figures_tables_and_configurations_do_not_wait_for_torch():
    rooms = "config, dataset, fields, fitting, imaging, moulds, plotting, studies"
    modules = (
        "plotting.front, plotting.evaluation, plotting.fits, plotting.overlay, plotting.sweep, "
        "studies.evaluation, studies.sweep, studies.tradeoff, studies.active_learning, report.model_card"
    )
    imports = "; ".join(f"import raptor.{name.strip()}" for name in f"{rooms}, {modules}".split(","))
    code = f"import sys; {imports}; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
