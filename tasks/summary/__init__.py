"""What a user reads after a command: report content, gallery, grid summary, metric labels.

Begin with `report_content`.
"""
