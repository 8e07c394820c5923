"""An arm of two hinges and a slide, written by hand in MJCF and in URDF."""

MJCF = """\
<mujoco model="arm">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep="0.001" gravity="0 0 -9.81" integrator="Euler"/>
  <worldbody>
    <body name="upper" pos="0 0 1.2" euler="0.3 0 0">
      <joint name="shoulder" type="hinge" axis="0 1 0" damping="0.07"/>
      <inertial pos="0.02 0 -0.21" mass="1.7"
                fullinertia="0.041 0.039 0.006 0.0011 -0.0023 0.0009"/>
      <body name="fore" pos="0.01 0.05 -0.45">
        <joint name="elbow" type="hinge" axis="0.6 0.8 0" stiffness="2.5" springref="0.4"/>
        <inertial pos="0 0.03 -0.19" mass="0.9" fullinertia="0.017 0.016 0.003 0 0.0004 0"/>
        <body name="hand" pos="0 0 -0.4">
          <joint name="reach" type="slide" axis="0 0 -1" range="-0.2 0.3" limited="true"
                 stiffness="300" damping="1.3"/>
          <inertial pos="0.015 -0.01 -0.06" mass="0.35" diaginertia="0.0008 0.0009 0.0005"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

URDF = """\
<robot name="arm">
  <link name="ground"/>
  <link name="upper"><inertial><origin xyz="0.02 0 -0.21"/><mass value="1.7"/>
    <inertia ixx="0.041" iyy="0.039" izz="0.006" ixy="0.0011" ixz="-0.0023" iyz="0.0009"/>
  </inertial></link>
  <link name="fore"><inertial><origin xyz="0 0.03 -0.19"/><mass value="0.9"/>
    <inertia ixx="0.017" iyy="0.016" izz="0.003" ixy="0" ixz="0.0004" iyz="0"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0.015 -0.01 -0.06"/><mass value="0.35"/>
    <inertia ixx="0.0008" iyy="0.0009" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="continuous">
    <parent link="ground"/>
    <child link="upper"/>
    <origin xyz="0 0 1.2" rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="0.07"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/>
    <child link="fore"/>
    <origin xyz="0.01 0.05 -0.45"/>
    <axis xyz="0.6 0.8 0"/>
  </joint>
  <joint name="reach" type="prismatic">
    <parent link="fore"/>
    <child link="hand"/>
    <origin xyz="0 0 -0.4"/>
    <axis xyz="0 0 -1"/>
    <limit lower="-0.2" upper="0.3" effort="1000" velocity="1000"/>
    <dynamics damping="1.3"/>
  </joint>
  <gazebo reference="elbow">
    <springStiffness>2.5</springStiffness>
    <springReference>0.4</springReference>
  </gazebo>
  <gazebo reference="reach">
    <springStiffness>300</springStiffness>
    <springReference>0</springReference>
  </gazebo>
</robot>
"""
