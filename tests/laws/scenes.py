"""Small scenes in which every kind of row or drive acts."""

HEAD = '<mujoco><option timestep="0.002" {}/>'

DRIVES = (
    HEAD
    + """<worldbody><body pos="0 0 1"><joint name="a" axis="0 1 0" actuatorfrcrange="-6 5"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/><site name="s" pos=".3 0 .05"/>
<body pos=".4 0 0"><joint name="b" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/><site name="t" pos=".2 0 .03"/>
</body></body></worldbody><tendon>
<spatial name="m"><site site="s"/><site site="t"/></spatial>
<fixed name="f" actuatorfrcrange="-1 1"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/>
</fixed></tendon><actuator>
<motor joint="a" gear="3" ctrlrange="-1 1"/><position joint="a" kp="40" kv="2" forcerange="-3 3"/>
<velocity joint="b" kv="3"/><intvelocity joint="b" kp="5" actrange="-.5 .7"/>
<general joint="b" dyntype="filter" dynprm=".03" gaintype="affine" gainprm="1 .5 .2"
 biastype="affine" biasprm=".1 -2 -.3"/>
<general joint="a" dyntype="filterexact" dynprm=".01" gainprm="2" actearly="true"/>
<muscle tendon="m" ctrlrange="0 1" lengthrange=".1 .4"/>
<muscle tendon="m" tausmooth=".2" lengthrange=".15 .35" force="30"/>
<motor tendon="f" gear="2"/><velocity tendon="f" kv=".5"/>
<motor site="t" gear="0 0 1 0 .2 0"/><damper joint="a" kv="2" ctrlrange="0 1"/>
<cylinder joint="b" timeconst=".02" area=".01" bias="1 2 3"/></actuator></mujoco>"""
)

LIMITS = (
    HEAD
    + """<worldbody><body pos="0 0 1"><joint name="a" axis="0 1 0" range="-5 10" margin=".02"
 solreflimit="-800 -30" solimplimit=".8 .97 .05 .3 3" frictionloss=".4" damping=".2"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/><site name="s" pos=".3 0 .05"/>
<body pos=".4 0 0"><joint name="b" type="slide" axis="0 1 1" range="-.01 .02" armature=".1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/><site name="t" pos=".2 0 .03"/>
<body pos=".1 .2 0"><joint name="c" type="ball" range="0 12" damping=".05" frictionloss=".1"
 solreffriction=".01 .7"/><geom size=".1 .05 .03" type="box" pos=".1 0 .1"/></body></body></body>
</worldbody><tendon><spatial name="m" range=".25 .31" frictionloss=".3" solreflimit=".01 .6">
<site site="s"/><site site="t"/></spatial>
<fixed name="f" range="-.02 .02" margin=".01" frictionloss="1"><joint joint="a" coef="1"/>
<joint joint="b" coef="-3"/></fixed></tendon></mujoco>"""
)

_LOOPS = (
    HEAD
    + """<worldbody><body name="p" pos="0 0 1"><joint name="a" axis="0 1 0" ref="10"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/><site name="s" pos=".3 0 .05"/>
<body name="q" pos=".4 0 0"><joint name="b" axis="0 1 .2"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/><site name="t" pos=".2 0 .03"/>
</body></body><body name="r" pos=".6 .3 1"><joint name="c" type="ball"/>
<geom size=".1 .05 .03" type="box" pos=".1 0 .1"/></body>
<body name="u" pos="0 1 1"><freejoint/>
<geom size=".1 .05 .03" type="box" contype="0" conaffinity="0"/>
<site name="us" pos=".1 0 .02" euler="20 30 10"/></body></worldbody><tendon>
<fixed name="f"><joint joint="a" coef="1"/><joint joint="b" coef="-3"/></fixed>
<spatial name="m"><site site="s"/><site site="t"/></spatial></tendon><equality>
<joint joint1="a" joint2="b" polycoef=".1 .5 .2 -.3 .1"/><joint joint1="a" polycoef=".2"/>
<tendon tendon1="m" tendon2="f" polycoef="0 .1 .02"/><tendon tendon1="f"/>
EQUALITIES</equality></mujoco>"""
)

CONNECT = _LOOPS.replace(
    "EQUALITIES",
    '<connect body1="q" body2="r" anchor=".3 0 0" solref=".03 .8"/><connect site1="us" site2="t"/>'
    '<connect body1="u" anchor="0 .1 0"/>',
)
WELD = _LOOPS.replace(
    "EQUALITIES",
    '<weld body1="u" body2="q" torquescale=".7" solref=".1 1"/><weld site1="us" site2="t"/>'
    '<weld body1="u" torquescale="1.7" relpose="0 .1 .2 .9 .1 .2 .3"/>',
)

_TOUCH = (
    HEAD
    + """<worldbody><geom name="floor" type="plane" size="3 3 .1" condim="DIM" margin=".001"
 friction=".7 .02 .003" gap=".0005"/>
<geom type="box" pos="1 0 0" size=".2 .2 .2" priority="1" friction=".3 .1 .1" solref="-3000 -60"/>
<body pos="0 0 .05"><freejoint/><geom name="box" type="box" size=".1 .07 .05" mass="2" solmix="3"
 friction=".5 .01 .001" solimp=".7 .9 .02 .4 1.5"/></body>
<body pos=".3 0 .1"><freejoint/><geom type="sphere" size=".1" mass="1" condim="DIM" solmix="0"
 friction=".5 .05 .001" solref=".03 .5"/></body>
<body pos=".3 .05 .28"><freejoint/>
<geom type="capsule" size=".08 .1" mass="1" friction=".9 .01 .001" condim="DIM"/></body>
<body pos=".8 .6 .28"><joint type="slide" axis="0 0 1"/>
<joint type="slide" axis="1 0 0" armature=".5"/>
<geom type="capsule" size=".08 .21" mass="1" friction=".9 .01 .001" condim="DIM"/></body>
<body pos="1 0 .25"><freejoint/>
<geom type="box" size=".1 .07 .05" mass="2" friction=".5 .01 .001" condim="DIM"/></body>
</worldbody><contact>PAIR</contact></mujoco>"""
)

PAIR = _TOUCH.replace("DIM", "3").replace(
    "PAIR",
    '<pair geom1="floor" geom2="box" condim="6" friction=".4 .6 .01 .002 .003" solref=".03 .9"'
    ' solreffriction=".05 1.2" margin=".002"/>',
)
TOUCH = {dim: _TOUCH.replace("DIM", str(dim)).replace("PAIR", "") for dim in (1, 3, 4, 6)}

_INERTIAL = (
    '<inertial><origin xyz="{}"/><mass value="{}"/>'
    '<inertia ixx=".03" iyy=".02" izz=".025" ixy="0" ixz="0" iyz="0"/></inertial>'
)
_SHAPE = (
    '<collision><origin xyz="{}"/><geometry><{}/></geometry></collision>'
    '<contact><lateral_friction value="{}"/><restitution value=".6"/>{}</contact>'
)

URDF_ARM = f"""<robot name="arm"><link name="base">{_INERTIAL.format("0 0 0", 1)}</link>
<link name="upper">{_INERTIAL.format(".15 0 .02", 1.5)}
{_SHAPE.format(".3 0 0", 'sphere radius=".1"', 0.1, "")}</link>
<link name="lower">{_INERTIAL.format(".1 0 0", 0.8)}
{_SHAPE.format(".2 0 0", 'sphere radius=".08"', 0.03, "")}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-1" upper=".7" effort="7" velocity="9"/>
<dynamics damping=".2" friction=".1"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
<origin xyz=".3 0 0"/><axis xyz="0 1 0"/><limit lower="-.4" upper=".4" effort="900" velocity="9"/>
</joint></robot>"""
"""The elbow has no limit, but PyBullet moves the targets of its motor into this range."""

URDF_BOX = f"""<robot name="box"><link name="body">{_INERTIAL.format(".01 0 .02", 2)}
{_SHAPE.format("0 0 0", 'box size=".3 .2 .1"', 0.7, "")}</link>
<link name="wheel">{_INERTIAL.format("0 0 0", 0.3)}
{
    _SHAPE.format(
        "0 0 0", 'sphere radius=".07"', 0.9, '<stiffness value="30000"/><damping value="500"/>'
    )
}</link>
<joint name="axle" type="continuous"><parent link="body"/><child link="wheel"/>
<origin xyz=".3 0 0"/><axis xyz="0 1 0"/></joint></robot>"""

_COMPLIANT = """<collision><origin xyz="{}"/><geometry><{}/></geometry>
<drake:proximity_properties><drake:mu_static value="{}"/><drake:mu_dynamic value="{}"/>
<drake:point_contact_stiffness value="{}"/><drake:hunt_crossley_dissipation value="{}"/>
</drake:proximity_properties></collision>"""

URDF_LEG = f"""<robot name="leg" xmlns:drake="http://drake.mit.edu">
<link name="body">{_INERTIAL.format(".02 0 .01", 3)}
{_COMPLIANT.format(".1 .05 0", 'sphere radius=".1"', 0.71, 0.53, 2e5, 7)}
<collision><origin xyz="-.1 -.05 0"/><geometry><sphere radius=".1"/></geometry></collision></link>
<link name="shin">{_INERTIAL.format("0 0 -.1", 0.7)}
{_COMPLIANT.format("0 0 -.2", 'cylinder radius=".05" length=".1"', 0.37, 0.31, 3e5, 11)}</link>
<joint name="hip" type="revolute"><parent link="body"/><child link="shin"/>
<origin xyz=".2 .1 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>
<dynamics damping=".2"/></joint></robot>"""
"""A body on a floor, with the surfaces of two shapes, and one without."""

URDF_BALLS = f"""<robot name="balls"><link name="body">{_INERTIAL.format(".01 0 .02", 2)}
{_SHAPE.format("0 0 0", 'sphere radius=".1"', 0.7, "")}</link>
<link name="wheel">{_INERTIAL.format("0 0 0", 0.3)}
{_SHAPE.format("0 0 0", 'sphere radius=".07"', 0.9, "")}</link>
<joint name="axle" type="continuous"><parent link="body"/><child link="wheel"/>
<origin xyz=".3 0 0"/><axis xyz="0 1 0"/></joint></robot>"""
