"""Equations as text: the LaTeX of docstrings, one line of Unicode."""

from __future__ import annotations

import pytest

from lptn.basics.equations import equation_text


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"R(v) = R_0 / (1 + \gamma |v|)", "R(v) = R₀ / (1 + γ |v|)"),
        (r"\frac{1}{R'} = \frac{1 + \gamma \, s}{R}", "1/R′ = (1 + γ s)/R"),
        (r"Q = \frac{C_2}{t_2} (T_2 - T)", "Q = (C₂/t₂) (T₂ − T)"),
        (r"R(\Delta T) = R_0 \, e^{-\beta \Delta T}", "R(ΔT) = R₀ exp(−β ΔT)"),
        (r"Q \propto k_\tau(T)^{-2}", "Q ∝ k_τ(T)⁻²"),
        (r"\left( \frac{k_\tau}{k'_\tau} \right)^2", "(k_τ/k′_τ)²"),
        (r"\frac{1}{n} \sum_{i=1}^n T_i - T_s", "(1/n) Σ(i=1…n) T_i − T_s"),
        (r"Q = D \, \dot q^2", "Q = D q̇²"),
        (r"Q = k \, |\omega|^n", "Q = k |ω|ⁿ"),
        (r"T_\mathrm{ref} + t \cdot 1000\,\mathrm{K/h}", "T_ref + t · 1000 K/h"),
        (r"I \text{ where only the load-free torque is logged}", "I where only the load-free torque is logged"),
        (r"x^{a+b}", "x^(a+b)"),
        (r"\unheard_of{x}", r"\unheard_ofx"),
        (r"\frac{a", "a/()"),
        ("", ""),
    ],
)
def test_an_equation_as_text(latex: str, text: str) -> None:
    assert equation_text(latex) == text
