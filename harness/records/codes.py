"""Message codes: one table of everything that a check reports, each with cause and remedy.

XC1xx is what the audit finds in a file, XC2xx the cause of a difference, XC3xx a case that differs
or is unresolved, XC4xx a file that is refused or not read, XC5xx a change since the baseline, and
XC6xx a run that failed. A record's code follows from its kind, by this table.

`docs/messages/` has a page for each code, written by
`python -m physics_crosscheck.harness.results.messages docs/messages`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from physics_crosscheck.harness.records.base import Record


class Code(Record, frozen=True, kw_only=True):
    """A message that a check can report.

    Attributes:
        code: `XC` with three digits; it never changes its meaning.
        name: the same in words, as `wrong-number`.
        title: one sentence.
        cause: why it happens, and how engines behave.
        example: an excerpt of a file, or output.
        remedy: what to do.
        kinds: what reports it, as `audit:literal`, `cause:axis` or `case:DIFFERS:motion`.
    """

    code: str
    name: str
    title: str
    cause: str
    example: str
    remedy: str
    kinds: tuple[str, ...]


GROUPS: Mapping[str, str] = MappingProxyType(
    {
        "XC1": "Findings of the audit",
        "XC2": "Causes of a difference",
        "XC3": "Cases that differ or are unresolved",
        "XC4": "Files that are refused or not read",
        "XC5": "Changes since the baseline",
        "XC6": "Runs that failed",
    }
)
"""Title of each group, by the first characters of its codes."""


def finding_code(kind: str) -> str:
    """Return the code of an audit finding; empty for an unknown kind."""
    return _BY_KIND.get(f"audit:{kind}", "")


def cause_code(kind: str) -> str:
    """Return the code of a cause; empty for an unknown kind."""
    return _BY_KIND.get(f"cause:{kind}", "")


def case_code(outcome: str, kind: str) -> str:
    """Return the code of a case: by its kind, or else by its outcome; empty where it agrees."""
    exact = _BY_KIND.get(f"case:{outcome}:{kind}")
    return exact or _BY_KIND.get(f"case:{outcome}:", "")


def comparison_code(outcome: str, kind: str) -> str:
    """Return the code of a comparison of two files; empty where they agree."""
    return _BY_KIND.get(f"comparison:{outcome}") or case_code(outcome, kind)


def gate_code(status: str, kinds: Sequence[str]) -> str:
    """Return the code of a case in the gate: by its status, and what changed first."""
    first = next((kind for kind in kinds if kind != "text"), "")
    exact = _BY_KIND.get(f"gate:{status}:{first}")
    return exact or _BY_KIND.get(f"gate:{status}:", "")


def baseline_code(kind: str) -> str:
    """Return the code of a change since the baseline that a run reports."""
    return _BY_KIND.get(f"baseline:{kind}", "")


def part_code() -> str:
    """Return the code of an audit, a linearization or a diagnosis that failed."""
    return _BY_KIND["part:failed"]


def _code(code: str, name: str, title: str, **texts: str) -> Code:
    """Return an entry of the table; `kinds` is separated by commas, other texts are wrapped."""
    prose = {key: " ".join(texts[key].split()) for key in ("cause", "remedy")}
    kinds = tuple(kind.strip() for kind in texts["kinds"].split(","))
    example = texts["example"].strip("\n")
    return Code(code=code, name=name, title=title, example=example, kinds=kinds, **prose)


_AUDIT = (
    _code(
        "XC101",
        "wrong-number",
        "A number in the file differs from its declared value.",
        kinds="audit:literal",
        cause="""The sidecar binds this number to an expression of the system's constants. The
        file states another value. The error is larger than the last digit of the number.""",
        example="""
mujoco.xml:21  body[rod]/inertial@mass is 0.82, but m = 0.8 (relative error 2.5e-02)
""",
        remedy="""Write the value that the message names, or correct the constant in
        `system.py`. An editor that reads SARIF can apply the fix.""",
    ),
    _code(
        "XC102",
        "rounded-number",
        "A number in the file is its declared value, rounded.",
        kinds="audit:rounded",
        cause="""The number agrees with the expression in the sidecar to its last digit. The
        rest is cut off. A run can show this rounding as a difference of the same size.""",
        example="""
  <geom type="cylinder" size="0.333"/>       # the sidecar binds it to 1/3 m
""",
        remedy="""Nothing is wrong. Write more digits if the case must agree to more digits.""",
    ),
    _code(
        "XC103",
        "unreadable-binding",
        "A binding of the sidecar names no number of the file.",
        kinds="audit:binding",
        cause="""An address under `[bindings]` matches no number, or several, or its expression
        has an unknown name. The audit cannot compare that number.""",
        example="""
  [bindings]
  "body/joint[thetta]@damping" = "c"         # the joint is called theta
""",
        remedy="""Correct the address or the expression. The message names the closest match
        where there is one.""",
    ),
    _code(
        "XC104",
        "inertia-without-mass",
        "A link has inertia but no mass.",
        kinds="audit:massless",
        cause="""No body has moments of inertia without mass. Engines disagree on such a link.
        For the file below, MuJoCo ignores the moments and PyBullet uses them: the last joint of
        the arm moves differently.""",
        example="""
panda.urdf:218 of pybullet_data
  <link name="panda_link8">
    <inertial>
      <mass value="0.0"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial>
  </link>
""",
        remedy="""Set the mass, or remove the inertia as well if the link is only a frame.""",
    ),
    _code(
        "XC105",
        "negative-mass",
        "A link has a negative mass.",
        kinds="audit:negative mass",
        cause="""The file states a mass below zero, mostly by a typing or conversion error. Some
        engines refuse the file, others compute with the number.""",
        example="""
  <inertial><mass value="-0.8"/> ... </inertial>
""",
        remedy="""Write the mass in kg, as a positive number.""",
    ),
    _code(
        "XC106",
        "negative-moment",
        "A principal moment of inertia is negative.",
        kinds="audit:moments",
        cause="""The inertia tensor has a negative eigenvalue. Most often a product of inertia
        is too large, or has another unit than the moments. MuJoCo refuses the file. PyBullet
        sets the inertia to zero.""",
        example="""
  <inertia ixx="0.01" ixy="0.03" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
  # principal moments of inertia: -0.02, 0.01 and 0.04 kg m^2
""",
        remedy="""Check the sign and the size of `ixy`, `ixz` and `iyz`, and the reference
        point: a URDF states the tensor about the center of mass.""",
    ),
    _code(
        "XC107",
        "triangle-inequality",
        "The principal moments of inertia break the triangle rule.",
        kinds="audit:triangle",
        cause="""The largest principal moment of a body is at most the sum of the other two.
        MuJoCo refuses such a tensor. PyBullet sets the link's inertia to zero. Newton enlarges
        it.""",
        example="""
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.05"/>
  # 0.05 is more than 0.01 + 0.01
""",
        remedy="""Export the tensor again from the CAD program, about the center of mass. Check
        units and axes. `balanceinertia` of MuJoCo hides the error and changes the motion.""",
    ),
    _code(
        "XC108",
        "inertia-not-finite",
        "The mass or inertia of a link is not finite.",
        kinds="audit:not finite",
        cause="""A mass, a center of mass or an inertia is `nan` or `inf`, or overflows when the
        file is read. Every acceleration that depends on it is undefined.""",
        example="""
  <inertia ixx="nan" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
""",
        remedy="""Write finite numbers. Look for a division by zero in the program that exported
        the file.""",
    ),
    _code(
        "XC109",
        "negative-damping",
        "A joint has negative damping.",
        kinds="audit:negative damping",
        cause="""Damping below zero adds energy to every motion of the joint. Engines compute
        with it without a warning, and the motion grows.""",
        example="""
damp.urdf:12
  <dynamics damping="-0.4"/>
""",
        remedy="""Write a positive number.""",
    ),
    _code(
        "XC110",
        "negative-stiffness",
        "A spring has negative stiffness.",
        kinds="audit:negative stiffness",
        cause="""Such a spring pushes a joint away from its rest position. That is physical for
        a linearized load, but it is often a sign error.""",
        example="""
  <joint name="hinge" stiffness="-12"/>
""",
        remedy="""Check the sign.""",
    ),
    _code(
        "XC111",
        "negative-armature",
        "A joint has negative armature.",
        kinds="audit:negative armature",
        cause="""Armature is the reflected inertia of a motor. Below zero it takes inertia from
        the joint and can make the mass matrix singular.""",
        example="""
  <joint name="elbow" armature="-0.03"/>
""",
        remedy="""Write a positive number.""",
    ),
    _code(
        "XC121",
        "inertia-differs",
        "The engine compiled another inertia than the equations have.",
        kinds="audit:inertia",
        cause="""The audit measures the mass matrix of the loaded model, without motion. One
        entry differs from the equations by more than its uncertainty. A wrong mass, tensor,
        length or armature causes it.""",
        example="""
inertia of theta is 0.0978 in the model and 0.096 in the equations
""",
        remedy="""Look first at findings XC101 to XC111 of the same file. Then check whether the
        engine recomputes inertias (XC151) or adds armature.""",
    ),
    _code(
        "XC122",
        "damping-differs",
        "The engine compiled another damping than the equations have.",
        kinds="audit:damping",
        cause="""The audit measures the forces that change sign with the velocity. A wrong
        damping number causes a difference, and so do dampers that the engine adds or ignores.
        PyBullet, for example, damps every link by 0.04 unless it is switched off.""",
        example="""
damping of theta is 0.02 in the model and 0 in the equations
""",
        remedy="""Compare the damping in the file with the equations, then the sidecar's
        settings.""",
    ),
    _code(
        "XC123",
        "stiffness-differs",
        "The engine compiled another stiffness than the equations have.",
        kinds="audit:stiffness",
        cause="""The audit measures how the forces at rest change with the positions. A wrong
        spring constant, length or gravity causes a difference.""",
        example="""
stiffness of x is 65.00006 in the model and 65 in the equations
""",
        remedy="""Compare spring constants, gravity and lever arms of the file with the
        equations.""",
    ),
    _code(
        "XC124",
        "unexpected-friction",
        "A friction acts that the equations lack.",
        kinds="audit:friction",
        cause="""A force opposes the motion and keeps its size at every speed. `frictionloss` in
        MuJoCo and joint friction in DART do that.""",
        example="""
  <joint name="x" type="slide" frictionloss="0.3"/>
""",
        remedy="""Remove the friction from the file, or compare the model without equations:
        `crosscheck compare`.""",
    ),
    _code(
        "XC125",
        "rest-force",
        "A force acts at rest that the equations lack.",
        kinds="audit:rest",
        cause="""At an equilibrium of the equations the model accelerates. A shifted rest
        position of a spring, another gravity or another zero of a joint causes it.""",
        example="""
a force of 0.49 acts on theta at rest in equilibrium 'hanging', but the equations have none there
""",
        remedy="""Check `springref`, `springlength`, gravity and the zero of the joint.""",
    ),
    _code(
        "XC126",
        "acceleration-differs",
        "Accelerations differ at random states.",
        kinds="audit:acceleration",
        cause="""The audit compares accelerations at 24 random states of the motions. They
        differ, although no single term about an equilibrium may show it: the error grows with
        the amplitude or with the velocity.""",
        example="""
the acceleration of theta is -12.31 in the model and -12.28 in the equations at theta = 0.8
""",
        remedy="""Fix the terms that are reported beside it first. Otherwise look at
        what is nonlinear: quadratic drag, a joint limit, a center of mass off its axis.""",
    ),
    _code(
        "XC127",
        "extra-degree-of-freedom",
        "An engine coordinate leaves the coordinate map.",
        kinds="audit:freedom",
        cause="""The sidecar states how the engine's coordinates follow from those of the
        equations. The engine accelerates one of them differently: a constraint is missing, soft
        or not active.""",
        example="""
fall accelerates away from the coordinate map with 3.7025 at x = -0.216, x_dot = 0.07591
  (24 of 24 random states differ): the model has an additional degree of freedom
""",
        remedy="""Add the constraint to the file, or make it stiff enough. Soft constraints are
        reported as XC148.""",
    ),
    _code(
        "XC128",
        "linearization-differs",
        "The engine's own linearization differs from the Taylor expansion.",
        kinds="audit:linearization",
        cause="""The engine returns matrices A and B about an equilibrium. They differ from the
        first derivatives of the equations by more than their uncertainty.""",
        example="""
the engine's own linearization about 'rest' differs from the equations' in A by 3.1e-03
""",
        remedy="""If the model's motions agree, do not use that linearization in a controller:
        take the matrices of `crosscheck derive`.""",
    ),
    _code(
        "XC129",
        "unresolved-term",
        "A term could not be measured without motion.",
        kinds="audit:unresolved",
        cause="""Friction or a joint limit hides the term, or the engine returns too few digits.
        The audit leaves it open; the motions still test it.""",
        example="""
friction hides stiffness and rest forces: it holds what is at rest
""",
        remedy="""Nothing is wrong. Remove the friction or move the joint limit if the audit
        should test the term.""",
    ),
    _code(
        "XC130",
        "wrong-pose",
        "A frame of the model stands elsewhere than in the equations.",
        kinds="audit:pose",
        cause="""Motions of joints can agree although a link, a tool or a sensor stands at the
        wrong place. The audit compares positions and rotations of the frames under
        `[frames]`.""",
        example="""
  [frames]
  tip = "site:tip"        # 2 mm beside the tip of the equations
""",
        remedy="""Correct the pose in the file, or the frame in `system.py`.""",
    ),
    _code(
        "XC131",
        "unreadable-frames",
        "The frames of the sidecar can't be found.",
        kinds="audit:frames",
        cause="""An entry under `[frames]` names no body, link or site of the loaded model. No
        pose was compared.""",
        example="""
  [frames]
  tip = "site:tipp"       # the site is called tip
""",
        remedy="""Correct the name. The message lists those that the model has.""",
    ),
    _code(
        "XC141",
        "missing-inertial",
        "A moving link has no <inertial>.",
        kinds="audit:inertial",
        cause="""Each engine fills in a value of its own. PyBullet and DART take 1 kg. MuJoCo,
        Newton and SAPIEN compute the mass from shapes. Drake, Pinocchio and iDynTree take zero.
        The same file becomes a different robot in each engine.""",
        example="""
  <link name="upper_shoulder"/>      <!-- a frame, but 1 kg in PyBullet -->
""",
        remedy="""Write an `<inertial>`. For a link that is only a frame, set the mass to 0.""",
    ),
    _code(
        "XC142",
        "ignored-element",
        "The engine ignores a part of the file.",
        kinds="audit:ignored",
        cause="""The format allows the element, but this engine does not read it, or reads it
        without effect. The motion is that of a file without it.""",
        example="""
  <transmission name="elbow_transmission"> ... </transmission>
""",
        remedy="""Remove it if it is not needed. If it matters, use an engine that reads it:
        `docs/engines.md` lists what each one ignores.""",
    ),
    _code(
        "XC143",
        "dry-friction",
        "The file states dry friction.",
        kinds="audit:dry friction",
        cause="""Dry friction is not smooth, so no step size converges where a joint sticks. For
        a URDF, MuJoCo and DART apply it. PyBullet, Drake, Pinocchio, Newton, iDynTree and
        SAPIEN ignore it.""",
        example="""
  <dynamics damping="0.1" friction="0.4"/>
""",
        remedy="""Remove the friction for the check. Decide in your simulator's own settings
        which friction to apply.""",
    ),
    _code(
        "XC144",
        "joint-limit-reached",
        "The motions reach a joint limit.",
        kinds="audit:joint limit",
        cause="""The limit stops the joint, which the equations do not have. From there on the
        model and the equations differ. Engines also differ in how softly they stop a joint.""",
        example="""
  <joint name="theta" type="hinge" range="-2 2"/>   <!-- the motion reaches 2.6 rad -->
""",
        remedy="""Widen the limit, or choose a scenario with a smaller range of motion.""",
    ),
    _code(
        "XC145",
        "untested-limit",
        "No motion reaches a joint limit or a contact.",
        kinds="audit:reach",
        cause="""The file has a joint limit, or shapes that can collide. The motions stay clear
        of them, so the check does not cover them.""",
        example="""
  theta is limited to [-3, 3], and the motions stay between -0.8 and 0.8
""",
        remedy="""Nothing is wrong. The report lists the limit as untested.""",
    ),
    _code(
        "XC146",
        "empty-limit",
        "A joint limit has no effect.",
        kinds="audit:empty limit",
        cause="""The lower limit is above the upper one, both are equal, or the joint is
        continuous. Most engines ignore such a limit and leave the joint free. Some hold the
        joint still.""",
        example="""
  <limit lower="0.5" upper="-0.5" effort="10" velocity="1"/>
""",
        remedy="""Swap the numbers, or remove the limit. Write `type="fixed"` if the joint must
        not move.""",
    ),
    _code(
        "XC147",
        "contact",
        "Shapes of the model touch or can collide.",
        kinds="audit:contact",
        cause="""Contact forces act that the equations do not have. They often come from
        collision shapes of neighbors that overlap at the joint.""",
        example="""
  <geom name="rod" .../> and <geom name="base" .../> overlap at the hinge
""",
        remedy="""Exclude the pair (`<exclude>`, `contype="0"`), or shrink the shapes.""",
    ),
    _code(
        "XC148",
        "soft-constraint",
        "A constraint is soft, limited or not active.",
        kinds="audit:constraint",
        cause="""The engine holds the constraint by a stiff spring or a correction over several
        steps. MuJoCo's default `solref` of 0.02 s and pymunk's default `error_bias` are such
        values. The error stays at any step size.""",
        example="""
  <equality><joint joint1="wheel" joint2="cart"/></equality>   <!-- solref="0.02 1" -->
""",
        remedy="""Use a stiffer setting, such as a smaller `solref`, or declare the joint so
        that it needs no constraint.""",
    ),
    _code(
        "XC149",
        "engine-setting",
        "A setting of the sidecar changes the model.",
        kinds="audit:setting",
        cause="""The sidecar keeps something of the engine active that the check switches off by
        default, such as PyBullet's joint motors or link damping. Or it overrides a value of the
        file.""",
        example="""
  [settings]
  motors = true           # every joint of PyBullet is held by a motor
""",
        remedy="""Remove the setting to check the file itself. Keep it to reproduce a
        script.""",
    ),
    _code(
        "XC150",
        "engine-warning",
        "The engine warns while it loads or runs the model.",
        kinds="audit:warning",
        cause="""The engine printed a warning of its own. Its text follows in the message.""",
        example="""
  MuJoCo warns: inertia matrix is too close to singular at DOF 2
""",
        remedy="""Read the engine's text. If a case differs as well, start here.""",
    ),
    _code(
        "XC151",
        "recomputed-inertia",
        "The engine replaces masses or inertias of the file.",
        kinds="audit:replaced",
        cause="""An option makes the engine change what the file states. MuJoCo has
        `settotalmass`, `boundmass`, `boundinertia` and `balanceinertia`. Newton enlarges
        tensors that break the triangle rule. Another engine reads the file without that.""",
        example="""
  <mujoco><compiler balanceinertia="true"/></mujoco>
""",
        remedy="""Write the intended numbers into the file, and remove the option.""",
    ),
    _code(
        "XC152",
        "engine-default",
        "The engine assumes or adds something by itself.",
        kinds="audit:default",
        cause="""The file leaves a value open, or the engine adds a force. The message names the
        value that the engine uses. It is an error only where a wrong term depends on it.""",
        example="""
  no gravity is stated: MuJoCo takes (0, 0, -9.81)
""",
        remedy="""State the value in the file if it matters, so that every engine uses the same
        one.""",
    ),
)

_CAUSES = (
    _code(
        "XC201",
        "number-differs",
        "A number in the file explains the difference.",
        kinds="cause:literal",
        cause="""The diagnosis fits each number of the file to the measured motions. With one
        other value of this number the motions agree. The message names the file, the line, the
        value that the motion implies and its standard error.""",
        example="""
  mujoco.xml:21  inertial[disc]@diaginertia[2] is 0.024012; the motion implies 0.024
""",
        remedy="""Write the value that the motion implies, if the equations are right. Otherwise
        correct the constant in `system.py`.""",
    ),
    _code(
        "XC202",
        "numbers-differ",
        "Several copies of one number explain the difference.",
        kinds="cause:literals",
        cause="""The file states one quantity at several places, and all of them are wrong by
        the same ratio. The diagnosis changes them together.""",
        example="""
  <geom mass="0.9"/> <geom mass="0.9"/> <geom mass="0.9"/>    # each must be 0.8
""",
        remedy="""Change all the lines that the message lists.""",
    ),
    _code(
        "XC203",
        "unbound-number",
        "A number that the sidecar does not bind explains the difference.",
        kinds="cause:unbound literal",
        cause="""No constant of the equations stands for this number, so the audit can't test
        it. The motions agree with another value of it, often zero or the format's default.""",
        example="""
  mujoco.xml:14  joint[theta]@armature is 0.001; the motion implies 0
""",
        remedy="""Correct or remove the number. If it belongs to the model, add it to the
        equations.""",
    ),
    _code(
        "XC204",
        "number-read-differently",
        "The engine uses another value than the file states.",
        kinds="cause:taken",
        cause="""The equations come from the file itself. The engine moves as if this number had
        another value: it converts units, clips, rounds or misreads it.""",
        example="""
  pendulum.urdf:9  robot/joint[hinge]/axis@xyz is 2 in the file, 1 in the engine
""",
        remedy="""Write the number in a way that all engines read alike: unit axes, radians,
        explicit attributes. Report it to the engine if its documentation differs.""",
    ),
    _code(
        "XC205",
        "numbers-ignored",
        "The engine ignores numbers of the file.",
        kinds="cause:dropped",
        cause="""The engine moves as if these numbers were zero. Some engines drop the moments
        of a link without mass. Converters and importers drop attributes without a warning, for
        example `<dynamics damping>`.""",
        example="""
panda.urdf in MuJoCo
  moments of link[panda_link8]/inertial/inertia (panda.urdf:222) in the file, 0 in the engine
""",
        remedy="""Set the value by the engine's own interface after loading, or use another
        format.""",
    ),
    _code(
        "XC206",
        "gravity-differs",
        "Another gravity explains the difference.",
        kinds="cause:gravity",
        cause="""The engine's gravity has another size or direction than the equations. URDF
        states no gravity, so the engine or the sidecar sets it.""",
        example="""
  gravity along z is -9.81; the motion implies -9.80665
""",
        remedy="""Set `gravity` in the sidecar or in the file.""",
    ),
    _code(
        "XC207",
        "engine-behavior",
        "Something that the engine does by itself explains the difference.",
        kinds="cause:default",
        cause="""With one default of the engine switched off, the motions agree. Examples are
        joint motors and link damping of PyBullet, 1 kg for a link without `<inertial>`, and
        inertias from collision shapes.""",
        example="""
leg.urdf in PyBullet: E = 9.8e-01
  PyBullet's own 1 kg and 1 kg m^2 of a link without <inertial> (upper_shoulder) explains the motion
""",
        remedy="""Switch the default off in your script as well, or state the value in the file.
        `docs/engines.md` lists the defaults of each engine.""",
    ),
    _code(
        "XC208",
        "axis-reversed",
        "A joint turns in the opposite direction.",
        kinds="cause:axis",
        cause="""The motions agree once the sign of this joint is changed. The axis in the file
        points the other way, or the coordinate map has the wrong sign.""",
        example="""
  <axis xyz="0 -1 0"/>        # the equations turn about +y
""",
        remedy="""Reverse the axis in the file, or the sign under `[coordinates]`.""",
    ),
    _code(
        "XC209",
        "zero-shifted",
        "The zero of a joint is shifted.",
        kinds="cause:zero",
        cause="""The motions agree once a constant is added to this coordinate. The file's
        reference position differs from that of the equations.""",
        example="""
  zero of theta is 0.1 in the model, 0 in the equations
""",
        remedy="""Correct `ref`, the pose of the joint or the offset under `[coordinates]`.""",
    ),
    _code(
        "XC210",
        "constants-exchanged",
        "Two constants are exchanged.",
        kinds="cause:exchange",
        cause="""The motions agree once two constants swap their values: two masses, or two
        lengths.""",
        example="""
  m1, m2 exchanged explains the motion
""",
        remedy="""Swap the numbers in the file, or the bodies.""",
    ),
    _code(
        "XC211",
        "constant-differs",
        "Another value of a constant explains the difference.",
        kinds="cause:constant",
        cause="""No single number of the file explains the motions, but a constant of the
        equations does. Several numbers of the file may follow from that constant.""",
        example="""
  l is 0.52 in the model, 0.5 in the equations
""",
        remedy="""Correct all numbers that depend on the constant, or the constant.""",
    ),
    _code(
        "XC221",
        "additional-inertia",
        "The model has an inertia that the equations lack.",
        kinds="cause:inertia",
        cause="""The motions agree with one additional inertia on this coordinate. Armature, a
        forgotten body or a default mass causes it.""",
        example="""
  inertia on theta is 0.001 in the model, 0 in the equations
""",
        remedy="""Look for `armature` and for links that should have no mass.""",
    ),
    _code(
        "XC222",
        "additional-damping",
        "The model has a damping that the equations lack.",
        kinds="cause:damping",
        cause="""The motions agree with one additional linear damper on this coordinate. It is
        in the file, or the engine adds it.""",
        example="""
  damping on x is 0.04 in the model, 0 in the equations
""",
        remedy="""Set the damping in the file, and the engine's own damping, to zero.""",
    ),
    _code(
        "XC223",
        "additional-drag",
        "The model has a quadratic damping that the equations lack.",
        kinds="cause:quadratic damping",
        cause="""The motions agree with a force that grows with the square of the speed. A
        medium in the file (`density`, `wind`) does that.""",
        example="""
  <option density="1.2"/>
""",
        remedy="""Remove the medium, or add the drag to the equations.""",
    ),
    _code(
        "XC224",
        "additional-friction",
        "The model has a friction that the equations lack.",
        kinds="cause:friction",
        cause="""The motions agree with a force of constant size against the direction of
        motion.""",
        example="""
  <joint name="x" type="slide" frictionloss="0.3"/>
""",
        remedy="""Remove `frictionloss` or joint friction, and check for bodies that touch.""",
    ),
    _code(
        "XC225",
        "additional-spring",
        "The model has a spring that the equations lack.",
        kinds="cause:spring",
        cause="""The motions agree with one additional spring on this coordinate. A joint's
        stiffness, a soft joint limit or a position actuator does that.""",
        example="""
  <joint name="theta" stiffness="0.5"/>
""",
        remedy="""Remove the stiffness, or switch off the actuator.""",
    ),
    _code(
        "XC226",
        "additional-force",
        "The model has a constant force that the equations lack.",
        kinds="cause:offset force",
        cause="""The motions agree with one constant force on this coordinate. Typical sources are
        a spring's rest position, an actuator's bias, and gravity.""",
        example="""
  <joint name="x" stiffness="10" springref="0.05"/>
""",
        remedy="""Check `springref`, actuator biases and the direction of gravity.""",
    ),
)

_CASES = (
    _code(
        "XC301",
        "motion-differs",
        "The motion differs from the equations.",
        kinds="case:DIFFERS:motion, case:DIFFERS:",
        cause="""Extrapolating to zero step size removes the integrator's error. What is left is
        larger than its uncertainty, so the model itself differs from the equations.""",
        example="""
leg.urdf in PyBullet
  hip_dot ends the segment at state 9 9.85e-01 of its movement off; the uncertainty there is 4.5e-13
""",
        remedy="""Read the cause that the report names (XC2xx) and the findings of the audit
        (XC1xx). If no cause is named, several things are wrong at once: fix the findings
        first.""",
    ),
    _code(
        "XC302",
        "constraint-violated",
        "A coordinate leaves the coordinate map during the motion.",
        kinds="case:DIFFERS:coordinate map",
        cause="""Coordinates that must follow from others do not. The model has an additional
        degree of freedom, or a constraint gives way.""",
        example="""
  engine coordinate wheel leaves the coordinate map by 0.0021 over the segment at t = 0.4 s
""",
        remedy="""Make the constraint hold: see XC148. Or correct the map under
        `[coordinates]`.""",
    ),
    _code(
        "XC303",
        "accelerations-differ",
        "The accelerations differ from the equations.",
        kinds="case:DIFFERS:acceleration",
        cause="""The engine's accelerations at many states differ by more than their
        uncertainty. This test needs no time step, so it finds small errors in stiff models.""",
        example="""
  hip_ddot is 4.10e-06 of its largest off; the uncertainty is 3.0e-12
""",
        remedy="""Read the forces that the message lists: they name the term to look at.""",
    ),
    _code(
        "XC304",
        "poses-differ",
        "A body is not where the file puts it.",
        kinds="case:DIFFERS:pose",
        cause="""At the sampled positions a body of the robot has another position or orientation
        in the engine than the file's joints and origins give. Its motion may be right all the
        same, as for a frame without mass.""",
        example="""
arm.urdf in PyBullet
  tool (link:tool): off by up to 0.02 m from the equations' pose
""",
        remedy="""Look at the origins of the joints between the root and this body, and at what
        the engine does with links on fixed joints.""",
    ),
    _code(
        "XC311",
        "engine-does-not-step",
        "Every step size returned the same values.",
        kinds="case:UNRESOLVED:stands still",
        cause="""The engine did not move, or ignored the step size. Held joints, a sleeping body
        or a fixed step inside the adapter cause it.""",
        example="""
  every rung returned the same values: the engine did not step
""",
        remedy="""Check that the model can move: motors, `fixed` joints, sleeping, and the
        setting `step`.""",
    ),
    _code(
        "XC312",
        "diverges",
        "Smaller steps do not approach a limit.",
        kinds="case:UNRESOLVED:diverges",
        cause="""The results change by as much at fine steps as at coarse ones. Contacts, random
        numbers or a controller with its own clock cause it.""",
        example="""
  the ladder diverges: the limits of finer rungs do not converge
""",
        remedy="""Remove contacts and callbacks from the model for the check.""",
    ),
    _code(
        "XC313",
        "wrong-order",
        "The engine converges with another order than it claims.",
        kinds="case:UNRESOLVED:wrong order",
        cause="""Halving the step does not reduce the error by the factor that the integrator's
        order implies. The extrapolation is not trusted then. An integrator that treats a part
        of the forces differently, or a motion that is not smooth, causes it.""",
        example="""
  convergence order is 2.00 but the engine claims 4
""",
        remedy="""Choose another integrator in the sidecar. If all do the same, report it with
        the file.""",
    ),
    _code(
        "XC314",
        "not-smooth",
        "The motion is not smooth at one place.",
        kinds="case:UNRESOLVED:not smooth",
        cause="""Near the time that the message names, smaller steps do not approach a limit. A
        joint limit, a contact or dry friction acts there.""",
        example="""
  the ladder diverges near t = 0.8 s
""",
        remedy="""Choose a scenario that stays clear of it, or run robots with `smooth =
        true`.""",
    ),
    _code(
        "XC315",
        "coarse",
        "The uncertainty is larger than the resolution.",
        kinds="case:UNRESOLVED:coarse, case:UNRESOLVED:",
        cause="""No difference was found, but the result is known less precisely than was asked.
        Stiff parts, soft constraints or a nearly rough motion need smaller steps than the check
        takes.""",
        example="""
  the limit of x_dot is known to 4.1e-08 at best, where 1e-09 was asked
""",
        remedy="""Accept a coarser result with `--resolution`, or remove what is stiff.""",
    ),
    _code(
        "XC316",
        "rounding",
        "The engine's rounding hides the resolution.",
        kinds="case:UNRESOLVED:rounding",
        cause="""The engine's numbers have too few digits for what was asked. Single precision
        has 7. Constraints that divide a position by the step lose digits as well.""",
        example="""
  the limit of theta is known to 2.3e-07 at best, where 1e-09 was asked: rounding allows no more
""",
        remedy="""Use double precision, or ask for a coarser `--resolution`.""",
    ),
    _code(
        "XC317",
        "map-unresolved",
        "A constraint could not be tested to the resolution.",
        kinds="case:UNRESOLVED:coordinate map",
        cause="""The motions agree, but the coordinates that must follow from others are known
        less precisely than was asked.""",
        example="""
  whether engine coordinate wheel keeps to the coordinate map is known to 3e-08 at best
""",
        remedy="""Make the constraint stiffer or exact, or ask for a coarser `--resolution`.""",
    ),
    _code(
        "XC318",
        "full-run-differs",
        "Short segments agree, but a full run does not.",
        kinds="case:UNRESOLVED:full run",
        cause="""Each segment starts from the reference state, and all agree. A run from start
        to end does not converge to the motion. The engine carries something from step to step: a
        warm start, a delay or a controller state.""",
        example="""
  every segment agrees, but a run from start to end does not converge to the motion
""",
        remedy="""Switch off warm starts and callbacks, or reset their state.""",
    ),
    _code(
        "XC319",
        "step-dependent",
        "The model behaves differently at its own time step.",
        kinds="case:UNRESOLVED:time step",
        cause="""Runs with smaller steps predict the error at the file's own time step. The run
        there has another error, so something in the model depends on the step itself.""",
        example="""
  its error is 2.1e-02 off the 1.3e-03 that finer steps predict
""",
        remedy="""Look for gains, filters or constraint settings that are derived from `dt`.""",
    ),
    _code(
        "XC320",
        "models-differ",
        "Two compared models move differently.",
        kinds="comparison:DIFFERS",
        cause="""`crosscheck compare` starts both models in the same states, and their motions
        differ by more than the uncertainty of both. The message names the number with the largest
        effect, its lines in both files, and its share of the difference.""",
        example="""
robot.urdf:12 mass of hand: 0.68, robot.xml:31: 0.73 (98 % of the difference)
""",
        remedy="""Decide which file is right, and correct the other one. `crosscheck run` checks
        one file against the equations of its own bodies.""",
    ),
)

_FILES = (
    _code(
        "XC401",
        "unreadable-file",
        "The file can't be read or loaded.",
        kinds="case:FAILED:file",
        cause="""The file is missing, is not valid XML, or has a value that is not a number. Or
        the engine that must compile it can't load it: a mesh is missing, or a default of its
        own fails.""",
        example="""
unclosed.urdf:3: no XML at column 3: mismatched tag; write well-formed XML
xacro.urdf:6: value of <mass> of link 'rod' is '${m}'; expected a finite number
mesh.xml: MuJoCo can't load it: Error: Error opening file 'hand.stl'
""",
        remedy="""Fix the line that the message names. Expand xacro files first: `xacro
        arm.urdf.xacro > arm.urdf`.""",
    ),
    _code(
        "XC402",
        "unsupported-feature",
        "The engine or its adapter does not support a feature.",
        kinds="case:FAILED:unsupported, case:REFUSED:unsupported",
        cause="""The file is valid, but this engine can't run a part of it: a joint type, an
        element, a plugin, or a constraint. Another engine may.""",
        example="""
planar.urdf:9: joint 'hinge' is planar, which is not covered
plugin.xml:2: <extension>, which Pinocchio's adapter can't give it
""",
        remedy="""Remove the element, or write it as the message proposes. Or run the file in
        another engine: `--engine NAME`. `docs/engines.md` lists what each engine supports.""",
    ),
    _code(
        "XC403",
        "file-refused",
        "An engine refuses a file that others may load.",
        kinds="case:REFUSED:",
        cause="""Engines check files more or less strictly. MuJoCo refuses inertias that break
        the triangle rule. PyBullet would set such an inertia to zero, so its adapter refuses
        the file as well. Nothing was tested in this engine.""",
        example="""
triangle.urdf: MuJoCo can't load it: Error: inertia must satisfy A + B >= C;
  use 'balanceinertia' to fix Element name 'rod', id 2
""",
        remedy="""Fix what the engine's message names. The audit often reports the same number
        with a line (XC1xx).""",
    ),
    _code(
        "XC404",
        "wrong-format",
        "The engine does not read this file format.",
        kinds="case:FAILED:format",
        cause="""The sidecar names an engine that has no reader for the suffix of the file.""",
        example="""
  robot.urdf.toml
    engines = ["pymunk"]      # reads .py files only
""",
        remedy="""Remove the engine from `engines`, or add a model file in its format.""",
    ),
    _code(
        "XC405",
        "unknown-engine",
        "The sidecar names an unknown engine.",
        kinds="case:FAILED:engine",
        cause="""No installed adapter has this name. A typing error, or a plugin that is not
        installed.""",
        example="""
  engines = ["mujocco"]
""",
        remedy="""Correct the name: `crosscheck engines` lists all.""",
    ),
    _code(
        "XC406",
        "sidecar-error",
        "The sidecar is missing, unreadable or contradicts itself.",
        kinds="case:FAILED:sidecar",
        cause="""The TOML file beside the model is not valid, has an unknown key, or does not fit
        the system. Examples: a coordinate without a partner, two rules for one setting.""",
        example="""
  [coordinates]
  thetta = "theta"            # the joint is called theta
""",
        remedy="""Fix the key that the message names. `docs/folder.md` describes all keys.""",
    ),
    _code(
        "XC407",
        "declaration-error",
        "The declaration in system.py is incomplete or inconsistent.",
        kinds="case:FAILED:declaration",
        cause="""`system.py` can't be turned into equations: a constant without a value, a wrong
        unit, an energy that depends on an unknown symbol.""",
        example="""
  Constant("m", 0.5, "kg*m", ...)      # the energy needs kg
""",
        remedy="""Fix the line that the message names.""",
    ),
    _code(
        "XC408",
        "not-a-tree",
        "The robot's file has no movable tree of bodies.",
        kinds="case:FAILED:robot",
        cause="""The equations need a tree: one root, one parent for each link, and mass behind
        each joint. A closed loop, two roots, an unknown link or a massless end link prevents
        it. All problems are reported together, each with its line.""",
        example="""
loop.urdf:16: link 'tip' has a second parent, by joint 'loop'
cloth_z_up.urdf: it has no joint that moves, so there is nothing to check
""",
        remedy="""Remove the joint that closes the loop, join the roots, or give the links mass
        and inertia.""",
    ),
)

_GATE = (
    _code(
        "XC501",
        "model-changed",
        "The model's motion changed since it was accepted.",
        kinds="gate:changed:model, gate:changed:",
        cause="""A model file or its sidecar changed, and the motion moved by more than the
        uncertainties of both runs.""",
        example="""
  - <inertial mass="0.50" .../>
  + <inertial mass="0.55" .../>
""",
        remedy="""If the change is intended, accept it with a reason: `crosscheck accept`.
        Otherwise revert the line that the gate shows.""",
    ),
    _code(
        "XC502",
        "case-missing",
        "An accepted case no longer exists.",
        kinds="gate:gone:, baseline:missing",
        cause="""The baseline has a case that the folders no longer have. A model, a scenario or
        an engine was renamed or removed.""",
        example="""
  accepted, but the case no longer exists
""",
        remedy="""Restore the case, or accept its removal with `crosscheck accept`.""",
    ),
    _code(
        "XC503",
        "case-new",
        "A case is not in the baseline yet.",
        kinds="gate:new:, baseline:new",
        cause="""The folders have a model, a scenario or an engine that was never accepted.""",
        example="""
  AGREES, not in the baseline yet
""",
        remedy="""Review the result and accept it: `crosscheck accept`.""",
    ),
    _code(
        "XC504",
        "case-improved",
        "A case is better than what was accepted.",
        kinds="gate:improved:, baseline:improvement",
        cause="""A known difference disappeared, or the error of a full run fell. The gate
        passes.""",
        example="""
  AGREES, accepted as DIFFERS
""",
        remedy="""Accept the better result, so that the gate protects it.""",
    ),
    _code(
        "XC505",
        "case-not-run",
        "A case could not be run or compared.",
        kinds="gate:could not run:",
        cause="""The run failed, the audit failed, or the files changed meanwhile. The gate
        counts it as a failure.""",
        example="""
  FAILED: mujoco.xml:4: unclosed tag
""",
        remedy="""Fix the failure that the message names, and run the gate again.""",
    ),
    _code(
        "XC506",
        "known-difference",
        "A case differs as it was accepted.",
        kinds="gate:known difference:",
        cause="""The case differs from the equations, and someone accepted this difference with
        a reason. It did not change.""",
        example="""
  DIFFERS, accepted: the engine adds 0.04 damping by design
""",
        remedy="""Nothing to do.""",
    ),
    _code(
        "XC507",
        "no-change-in-motion",
        "Files changed, but the motion did not.",
        kinds="gate:no change in motion:",
        cause="""A comment, a format, the engine's version or an untested number changed. The
        motion is the accepted one within the uncertainties.""",
        example="""
  changed: mujoco.xml
""",
        remedy="""Nothing to do. Accept the case to refresh the hashes of the baseline.""",
    ),
    _code(
        "XC508",
        "regression",
        "A case is worse than the accepted result.",
        kinds="baseline:regression",
        cause="""A run compared itself with the baseline. The case no longer agrees, could not
        be run, or has a larger error.""",
        example="""
  DIFFERS, accepted as AGREES
""",
        remedy="""Run `crosscheck gate`: it names what changed, by file and line.""",
    ),
    _code(
        "XC509",
        "case-changed",
        "A case changed since the baseline, and still agrees.",
        kinds="baseline:change",
        cause="""A run compared itself with the baseline. Model and equations, or the scenario,
        changed together.""",
        example="""
  model and equations changed alike, and agree
""",
        remedy="""Run `crosscheck gate`, and accept the change if it is intended.""",
    ),
    _code(
        "XC511",
        "engine-changed",
        "Another engine version moves the model differently.",
        kinds="gate:changed:engine",
        cause="""No file changed, but the engine's version did, and the motion moved.""",
        example="""
  engine version mujoco 3.3.2 -> mujoco 4.0.0
""",
        remedy="""Compare both versions with `crosscheck versions`. Pin the version, or accept
        the new result.""",
    ),
    _code(
        "XC512",
        "numerics-changed",
        "Another version of crosscheck computes the case differently.",
        kinds="gate:changed:tool",
        cause="""The numerics of this package changed between the two runs, and no file did.""",
        example="""
  version of crosscheck's numerics 4 -> 5
""",
        remedy="""Read the changelog, and accept the cases again.""",
    ),
    _code(
        "XC513",
        "equations-changed",
        "The equations changed since they were accepted.",
        kinds="gate:changed:equations",
        cause="""`system.py` declares other physics, or other coordinates or inputs.""",
        example="""
  the equations' motion changed by 2.1 % of its displacement, in theta near t = 0.5 s
""",
        remedy="""If the change is intended, accept all cases of the system.""",
    ),
    _code(
        "XC514",
        "scenario-changed",
        "The scenario changed since it was accepted.",
        kinds="gate:changed:scenario",
        cause="""The duration, an input or the initial state differs, so the motions are
        not comparable as a whole.""",
        example="""
  the scenario changed: duration 4 s -> 6 s
""",
        remedy="""If the change is intended, accept the case.""",
    ),
    _code(
        "XC515",
        "step-cost-changed",
        "The time step, integrator or error at dt changed.",
        kinds="gate:changed:numbers",
        cause="""The model's limit is the same, but a run at the file's own time step has
        another error or order.""",
        example="""
  step 0.002 s -> 0.01 s; error at dt 0.12 % -> 3.1 %
""",
        remedy="""Restore the step, or accept the larger error.""",
    ),
    _code(
        "XC516",
        "unexplained-change",
        "The motion changed, although nothing that it depends on did.",
        kinds="gate:changed:unexplained",
        cause="""Files, engine and tool are those of the baseline. Another machine, compiler or
        number of threads may compute differently.""",
        example="""
  the model's motion changed by 4.2e-09 ± 2e-12 of its displacement, in theta near t = 0 s
""",
        remedy="""Run it again. If it persists, compare the two machines.""",
    ),
    _code(
        "XC517",
        "outcome-changed",
        "The outcome changed, although the motion did not.",
        kinds="gate:changed:outcome",
        cause="""The result is near the border between two outcomes, or the time-stepping method
        differs.""",
        example="""
  UNRESOLVED, accepted as AGREES
""",
        remedy="""Read the reason of the case. Accept it if the method change is intended.""",
    ),
    _code(
        "XC518",
        "new-audit-finding",
        "The audit finds an error that was not accepted.",
        kinds="gate:changed:audit",
        cause="""No motion changed, but the audit reports a wrong number, pose or term that it
        did not report before.""",
        example="""
  the audit finds mujoco.xml:12: joint[theta]@damping is 0.024, but c = 0.02
""",
        remedy="""Fix it: the finding has a code of its own (XC1xx).""",
    ),
)

_RUNS = (
    _code(
        "XC601",
        "time-limit",
        "The case used up its processor time.",
        kinds="case:FAILED:time limit",
        cause="""A task may use 120 processor seconds by default. Large models, tiny steps or an
        endless loop in a model script exceed it.""",
        example="""
  it ran out of its 120 processor seconds; --limit raises it
""",
        remedy="""Raise the limit: `--limit 600`. Or shorten the scenario.""",
    ),
    _code(
        "XC602",
        "no-progress",
        "The case waited and did not end.",
        kinds="case:FAILED:waiting",
        cause="""The task used hardly any processor for ten times its limit. A model script
        sleeps, or waits for input, a lock or a network.""",
        example="""
  space.py:14: it has not ended in 1200 s by the clock
""",
        remedy="""Remove the wait at the line that the message names.""",
    ),
    _code(
        "XC603",
        "memory-limit",
        "The case needs more memory than its limit.",
        kinds="case:FAILED:memory limit",
        cause="""A worker may use 4 GiB by default. Meshes of many triangles or an endless list
        in a model script exceed it.""",
        example="""
  it needs more than the 4 GiB it may have; --memory raises it
""",
        remedy="""Raise the limit: `--memory 8`.""",
    ),
    _code(
        "XC604",
        "engine-crash",
        "The process crashed.",
        kinds="case:FAILED:crash",
        cause="""A signal such as a segmentation fault ended the worker process. The fault is in
        the engine or in a compiled part of the model. Other cases are not affected.""",
        example="""
  the process died (SIGSEGV); the cases beside it are not affected
""",
        remedy="""Load the file in the engine alone to reproduce it, and report it to the
        engine. The last printed lines follow the message.""",
    ),
    _code(
        "XC605",
        "process-exit",
        "The model's code ended the process.",
        kinds="case:FAILED:exit",
        cause="""The engine or a script called `exit`. A library that is missing can do so as
        well.""",
        example="""
  space.py:9: it ends the process, exit code 0
""",
        remedy="""Remove the call at the line that the message names.""",
    ),
    _code(
        "XC606",
        "engine-not-installed",
        "The engine is not installed.",
        kinds="case:ABSENT:",
        cause="""The file needs an engine that this Python environment does not have. Nothing
        was tested. With `--require-engines` this is a failure.""",
        example="""
  pymunk is not installed; pip install 'physics-crosscheck[engines]'
""",
        remedy="""Install the engine with the command in the message.""",
    ),
    _code(
        "XC607",
        "not-finite",
        "The motion is no longer finite.",
        kinds="case:FAILED:not finite",
        cause="""The engine returned `nan` or `inf`. The time step is too large for the fastest
        part of the model, or a mass is zero.""",
        example="""
  at the time step of 0.01 s the motion is no longer finite at t = 0.35 s
""",
        remedy="""Reduce the time step. Look for tiny inertias and stiff springs.""",
    ),
    _code(
        "XC608",
        "blows-up",
        "The motion grows without bound at the file's time step.",
        kinds="case:FAILED:blows up",
        cause="""The integrator is unstable at this step. The error exceeds the amplitude a
        million times.""",
        example="""
  at the time step of 0.02 s the motion blows up, to 3e+08 of its amplitude
""",
        remedy="""Reduce the time step, or use an implicit integrator.""",
    ),
    _code(
        "XC609",
        "step-too-coarse",
        "The time step is too coarse to follow the motion.",
        kinds="case:FAILED:too coarse",
        cause="""There are fewer than two steps in a period of the fastest motion, and the error
        exceeds the amplitude.""",
        example="""
  at the time step of 0.05 s nothing follows the motion
""",
        remedy="""Reduce the time step below the value that the report lists as `dt for 1
        %`.""",
    ),
    _code(
        "XC610",
        "invalid-step",
        "No run is possible with the file's time step.",
        kinds="case:FAILED:long step",
        cause="""The step is not positive, is longer than half the scenario, or is so small that
        the run has too many steps.""",
        example="""
  [settings]
  step = 10               # the scenario lasts 4 s
""",
        remedy="""Correct `step` at the line that the message names.""",
    ),
    _code(
        "XC611",
        "reference-failed",
        "The equations could not be solved precisely enough.",
        kinds="case:FAILED:reference",
        cause="""The solver of the equations did not reach its error bound. The equations are
        singular, extremely stiff, or the motion leaves their domain.""",
        example="""
  the reference could not be solved at t = 1.4 s: the mass matrix is singular
""",
        remedy="""Check the constants and the initial state of the scenario.""",
    ),
    _code(
        "XC612",
        "unexpected-error",
        "The case failed with an unexpected error.",
        kinds="case:FAILED:",
        cause="""The engine, a model script or this package raised an error that no rule covers.
        The message has its text, and the lines that were printed follow it.""",
        example="""
  space.py:21: KeyError: 'rod'
""",
        remedy="""Fix the line if it is in your file. Otherwise report it with the file.""",
    ),
    _code(
        "XC613",
        "check-failed",
        "An audit, a linearization or a diagnosis could not be done.",
        kinds="part:failed",
        cause="""A part of the check failed for this model, for the reason in the message. A
        check that could not run counts as a failure.""",
        example="""
  FAILED audit of disc/mujoco.xml [mujoco]: it needs more than the 4 GiB it may have
""",
        remedy="""Fix the reason in the message, or raise the limit that it names.""",
    ),
)

CODES: Mapping[str, Code] = MappingProxyType(
    {one.code: one for one in (*_AUDIT, *_CAUSES, *_CASES, *_FILES, *_GATE, *_RUNS)}
)
"""Every message, by its code."""

_BY_KIND = {kind: one.code for one in CODES.values() for kind in one.kinds}
