"""The paper, side by side: its figures and tables that data can redraw, beside ours."""
